// A point force on a half space: Boussinesq 1885; Johnson, Contact Mechanics (1985), eq. 3.18.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <numbers>

#include "palpate/geometry/shapes.hpp"
#include "support/statics.hpp"
#include "support/validation_table.hpp"

namespace palpate::test {
namespace {

constexpr double load = 0.1, side = 0.05;  // N, m

// At the distance |x|, > 0, from the force, which points along z into the half space z >= 0.
Vec3 boussinesq(const Vec3& x, const Material& m) {
  const double R = x.norm(), z = x.z(), k = load / (4 * std::numbers::pi * m.mu());
  const double outwards = z / (R * R * R) - (1 - 2 * m.poisson) / (R * (R + z));
  return k * Vec3(outwards * x.x(), outwards * x.y(), z * z / (R * R * R) + 2 * (1 - m.poisson) / R);
}

struct TopErrors {
  std::size_t nodes = 0;
  double largest = 0,
         mean = 0;  // of a node on the top from the fifth element on, over the displacement's norm
};

// A quarter of the block |x|, |y| <= side, z <= side: planes of symmetry, the exact displacement on the faces
// that cut it off, the force on the corner node, elements graded towards it.
TopErrors top_errors(int order, int cells, const Material& material) {
  TetMesh mesh = make_block({Vec3::Zero(), Vec3::Ones()}, {cells, cells, cells});
  for (Vec3& p : mesh.nodes) p = side * p.cwiseProduct(p.cwiseSqrt());
  const ElementNodes nodes = element_nodes(mesh, order);
  Vector u = Vector::Zero(static_cast<Eigen::Index>(3 * nodes.size())), force = u;
  std::vector<bool> fixed(3 * nodes.size(), false);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Vec3& p = nodes.positions[i];
    const auto row = static_cast<Eigen::Index>(3 * i);
    if (p.maxCoeff() > side - 1e-9) {
      u.segment<3>(row) = boussinesq(p, material);
      fixed[3 * i] = fixed[3 * i + 1] = fixed[3 * i + 2] = true;
    }
    for (std::size_t a = 0; a < 2; ++a)
      if (p[static_cast<Eigen::Index>(a)] < 1e-9) fixed[3 * i + a] = true;
    if (p.norm() < 1e-9) force[row + 2] = load / 4;
  }
  solve_statics(assemble_stiffness(mesh, nodes, {material}), fixed, force, u);
  // A force on one node is felt wrongly by the elements around it: the fifth node along an edge, and on.
  const double fifth = side * std::pow(5.0 / cells, 1.5);
  TopErrors errors{nodes.size()};
  std::size_t count = 0;
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) {
    const Vec3& p = mesh.nodes[i];
    if (p.z() > 1e-9 || fixed[3 * i + 2] || p.norm() < fifth - 1e-9) continue;
    const Vec3 exact = boussinesq(p, material);
    const double error = (u.segment<3>(static_cast<Eigen::Index>(3 * i)) - exact).norm() / exact.norm();
    errors.largest = std::max(errors.largest, error);
    errors.mean += error, ++count;
  }
  errors.mean /= static_cast<double>(count);
  return errors;
}

TEST(Boussinesq, PointForceOnAHalfSpace) {
  for (const double poisson : {0.3, 0.45, 0.49})
    for (const int order : {1, 2}) {
      const int cells = order == 1 ? 20 : 12;
      const TopErrors e = top_errors(order, cells, {10e3, poisson});
      std::printf("P%d, nu %.2f, %zu nodes: top from the 5th element on, largest %.2f %%, mean %.2f %%\n",
                  order, poisson, e.nodes, 100 * e.largest, 100 * e.mean);
      validation_row(
          "boussinesq", "order,poisson,cells,nodes,largest_error,mean_error",
          fmt::format("{},{},{},{},{:.4g},{:.4g}", order, poisson, cells, e.nodes, e.largest, e.mean));
      // Linear tetrahedra lock near the force.
      if (order == 2) {
        EXPECT_LT(e.largest, poisson < 0.49 ? 0.005 : 0.012) << poisson;
        EXPECT_LT(e.mean, 0.005) << poisson;
      }
    }
}

}  // namespace
}  // namespace palpate::test
