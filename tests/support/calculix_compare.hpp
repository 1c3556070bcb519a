// Our statics against CalculiX's on the same mesh, forces on every third node.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <random>

#include "palpate/elasticity/anchor.hpp"
#include "support/calculix.hpp"
#include "support/statics.hpp"
#include "support/validation_table.hpp"

namespace palpate::test {

// Forces on every third node that is not anchored, in all directions.
inline std::vector<Vec3> some_forces(const std::vector<std::uint8_t>& anchored) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> force(-0.01, 0.01);
  std::vector<Vec3> forces(anchored.size(), Vec3::Zero());
  for (std::size_t i = 0; i < anchored.size(); i += 3)
    if (!anchored[i]) forces[i] = Vec3(force(random), force(random), force(random));
  return forces;
}

inline void compare_with_calculix(const std::string& name, int order, const TetMesh& mesh,
                                  const std::vector<Material>& materials, const std::string& anchor) {
  const ElementNodes nodes = element_nodes(mesh, order);
  const auto anchored = with_middles(anchored_nodes(mesh, {parse_anchor(anchor)}), nodes);
  const auto forces = some_forces(anchored);
  const auto reference = calculix_static(mesh, nodes, materials, anchored, forces);
  if (!reference) GTEST_SKIP() << no_calculix;
  const auto u = solve_statics(mesh, nodes, materials, anchored, forces);
  double largest = 0, difference = 0;
  for (std::size_t i = 0; i < u.size(); ++i) {
    largest = std::max(largest, reference->displacement[i].cwiseAbs().maxCoeff());
    difference = std::max(difference, (u[i] - reference->displacement[i]).cwiseAbs().maxCoeff());
  }
  Vec3 total = Vec3::Zero();
  for (const Vec3& f : forces) total += f;
  std::printf("CalculiX, %s, %s: %zu nodes, %zu tetrahedra: %.1e of the largest displacement (%.3g m)\n",
              name.c_str(), order == 1 ? "C3D4" : "C3D10", nodes.size(), mesh.tets.size(),
              difference / largest, largest);
  validation_row("calculix_statics", "mesh,element,nodes,tetrahedra,difference_over_largest",
                 fmt::format("\"{}\",{},{},{},{:.2e}", name, order == 1 ? "C3D4" : "C3D10", nodes.size(),
                             mesh.tets.size(), difference / largest));
  EXPECT_GT(largest, 1e-6);
  EXPECT_LT(difference, 1e-6 * largest) << name;
  EXPECT_LT((reference->reaction + total).norm(), 1e-6 * total.norm());
}

}  // namespace palpate::test
