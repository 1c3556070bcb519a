// How far linear elasticity is off at depth, and whether the error bars say so: a cube of 10 cm, base fixed,
// and a rigid ball pressed in by up to a fifth of the cube, against CalculiX with large strains, of two
// materials whose moduli at rest are the same. Same tetrahedra; both frictionless.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "palpate/compliance/blas.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/simulation/error_bars.hpp"
#include "palpate/simulation/model.hpp"
#include "support/calculix.hpp"
#include "support/validation_table.hpp"

namespace palpate::test {
namespace {

const bool blas_is_set_up = (set_up_blas(), true);
const std::vector<Anchor> anchors{AnchorHalfSpace{Vec3::Zero(), Vec3::UnitZ()}};

TetMesh cube() { return make_block({Vec3(-0.05, -0.05, 0), Vec3(0.05, 0.05, 0.1)}, {9, 9, 9}); }

struct Pressed {
  double force;  // N
  ErrorBar bar;
  double strain;
};

Pressed press(const Material& material, double radius, double depth) {
  Model model;
  model.organ = bake(cube(), {material}, anchors, 0, {}, nullptr, {.order = 1, .pinch = false});
  model.instruments.push_back({"ball", Sphere{radius}, {}});
  State state = make_state(model);
  Input input;
  input.instruments.resize(1);
  for (int k = 1; k <= 40; ++k) {
    input.instruments[0].translation = Vec3(0, 0, 0.1 + radius - depth * k / 40);
    step(model, state, input);
  }
  EXPECT_EQ(state.status & not_converged, 0u);
  EXPECT_EQ((state.status & strain_beyond_linear) != 0, state.surface.strains.largest > linear_strain);
  return {state.wrenches[0].force.z(), error_bar(model.organ, state.surface), state.surface.strains.largest};
}

// Hooke's law between Green-Lagrange strain and second Piola-Kirchhoff stress goes soft under compression and
// gives way altogether before a fifth of the cube: there the neo-Hookean material alone is compared.
void compare(double poisson, double radius, std::initializer_list<double> depths) {
  const Material material{10e3, poisson};
  for (const double depth : depths) {
    const Pressed ours = press(material, radius, depth);
    TriangleMesh tool = make_sphere(Vec3(0, 0, 0.1 + radius), radius, 60, 120);
    for (const Elasticity e : {Elasticity::saint_venant, Elasticity::neo_hooke}) {
      if (e == Elasticity::saint_venant && depth > 0.015) continue;
      const auto theirs = calculix_contact(cube(), {material}, anchored_nodes(cube(), anchors), tool,
                                           Vec3(0, 0, -depth), 2e9, e);
      if (!theirs) GTEST_SKIP() << no_calculix;
      const double off = ours.force / theirs->force.z() - 1;
      const char* const law = e == Elasticity::saint_venant ? "St. Venant, Kirchhoff" : "neo-Hooke";
      std::printf(
          "nu %.2f, ball of %.0f mm, %2.0f mm deep, %s: force %.4f N, off by %+.1f %%, bar %.1f %%, largest "
          "strain %.1f %%\n",
          poisson, 1e3 * radius, 1e3 * depth, law, ours.force, 100 * off, 100 * ours.bar.linearity,
          100 * ours.strain);
      validation_row("large_strain", "poisson,radius_m,depth_m,material,force_N,off,bar,largest_strain",
                     fmt::format("{},{},{},{},{:.5f},{:.4f},{:.4f},{:.4f}", poisson, radius, depth, law,
                                 ours.force, off, ours.bar.linearity, ours.strain));
      EXPECT_LE(std::abs(off), ours.bar.linearity);
      EXPECT_LE(ours.bar.linearity, 0.3 + 4 * depth / 0.1) << "says nothing";
    }
  }
}

TEST(LargeStrain, TheBarCoversBallOf30mm) { compare(0.45, 0.03, {0.002, 0.005, 0.01, 0.02}); }
TEST(LargeStrain, TheBarCoversBallOf60mm) { compare(0.3, 0.06, {0.002, 0.01}); }

}  // namespace
}  // namespace palpate::test
