#include "palpate/simulation/strain.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "fixtures.hpp"
#include "palpate/simulation/error_bars.hpp"
#include "palpate/simulation/loop.hpp"
#include "palpate/simulation/recording.hpp"

namespace palpate {
namespace {

double largest(const Mat3& strain) {
  return Eigen::SelfAdjointEigenSolver<Mat3>(strain).eigenvalues().cwiseAbs().maxCoeff();
}

// A displacement that is linear in space, and the traction that it needs on the top: all of its gradient is
// read off the surface, turn included.
TEST(StrainGauge, ReadsALinearDisplacement) {
  const Organ organ = block_organ(6);
  const Material& m = organ.materials[0];
  Mat3 h;
  h << 0.02, -0.11, 0.03, 0.16, -0.05, 0.02, -0.01, 0.07, 0.04;
  const Mat3 linear = 0.5 * (h + h.transpose()), quadratic = 0.5 * h.transpose() * h;
  const Vec3 traction = (m.lambda() * h.trace() * Mat3::Identity() + 2 * m.mu() * linear) * Vec3::UnitZ();
  Surface surface = make_surface(organ);
  Loads& loads = surface.loads;
  std::vector<std::uint8_t> inside;  // the top, away from its edges
  for (std::size_t i = 0; i < organ.surface_size(); ++i) {
    const Vec3& p = organ.surface.vertices[i];
    surface.displacement[i] = (h * p).cast<float>();
    if (p.z() < 0.0999) continue;
    loads.rows[loads.count] = organ.row_of[i];
    loads.forces[loads.count++] = organ.areas[i] * traction;
    inside.push_back(std::abs(p.x()) < 0.049 && std::abs(p.y()) < 0.049);
  }
  StrainGauge gauge(organ);
  for (int twice = 0; twice < 2; ++twice) gauge(organ, loads, surface.displacement, surface.strains);
  for (std::size_t i = 0; i < loads.count; ++i) {
    if (!inside[i]) continue;
    const ContactStrain& strain = surface.strains.contacts[i];
    EXPECT_NEAR(strain.linear, linear.norm(), 1e-5);
    EXPECT_NEAR(strain.quadratic, quadratic.norm(), 1e-5);
    EXPECT_NEAR(strain.largest, std::max(largest(linear), largest(linear + quadratic)), 1e-5);
  }
  EXPECT_TRUE(surface.strains.beyond_linear());
}

// The bit is the surface's: a tick has none, nor has a hash; what a loop leaves is as after a step.
TEST(Strain, AWarningBeyondTheLinearRange) {
  const Model model = block_model(8, Sphere{0.03}, Mode::unilateral, 2);
  State state = make_state(model);
  double last = 0;
  for (const double depth : {0.0005, 0.002, 0.01}) {
    step(model, state, at(Vec3(0, 0, 0.13 - depth)));
    EXPECT_GT(state.surface.strains.largest, last);
    last = state.surface.strains.largest;
    EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
    EXPECT_EQ((state.status & strain_beyond_linear) != 0, depth > 0.005) << last;
  }
  State loop = make_state(model);
  LoopSettings settings;
  settings.ticks = 3, settings.rate = 100;
  LoopHooks hooks;
  hooks.input = [](std::uint64_t k, const State&, Input& input) {
    input = at(Vec3(0, 0, 0.13 - (k == 0 ? 0.0005 : k == 1 ? 0.002 : 0.01)));
    return true;
  };
  run_loop(model, loop, settings, hooks);
  EXPECT_EQ(loop.status, strain_beyond_linear);
  EXPECT_EQ(state_hash(loop), state_hash(state));
  EXPECT_TRUE(loop.surface.strains.beyond_linear());
  step(model, state, at(Vec3(0, 0, 0.5)));
  EXPECT_EQ(state.status, jumped);
  EXPECT_EQ(state.surface.strains.largest, 0.0);
}

// Forces on coarse elements against forces on fine ones, of contacts that three nodes share or more.
TEST(ErrorBar, CoversWhatTheElementsAreOff) {
  Model fine = block_model(13, Sphere{0.03}, Mode::unilateral, 2), coarse = fine;
  int compared = 0;
  for (const int n : {4, 5, 6, 8}) {
    coarse.organ = block_organ(n, {.order = 2});
    for (const double radius : {0.03, 0.08})
      for (const double depth : {0.006, 0.01}) {
        coarse.instruments[0].shape = fine.instruments[0].shape = Sphere{radius};
        State a = make_state(coarse), b = make_state(fine);
        step(coarse, a, at(Vec3(0, 0, 0.1 + radius - depth)));
        step(fine, b, at(Vec3(0, 0, 0.1 + radius - depth)));
        const ErrorBar bar = error_bar(coarse.organ, a.surface);
        EXPECT_TRUE(bar.discretisation_known);
        if (a.loads.count < 3) continue;
        const double off = a.wrenches[0].force.z() / b.wrenches[0].force.z() - 1;
        EXPECT_LE(std::abs(off), bar.discretisation + bar.resolution) << n << ' ' << radius << ' ' << depth;
        ++compared;
      }
  }
  EXPECT_GE(compared, 10);
}

TEST(ErrorBar, CoversWhatCompressionIsOff) {
  const Shape ball = Sphere{0.03};
  Model exact = block_model(8, ball), packed = block_model(8, ball);
  packed.organ =
      block_organ(8, {.order = 1, .storage = Storage::hierarchical, .tolerance = 1e-2, .pinch = false});
  State a = make_state(exact), b = make_state(packed);
  step(exact, a, at(Vec3(0, 0, 0.12)));
  step(packed, b, at(Vec3(0, 0, 0.12)));
  const double off = std::abs(b.wrenches[0].force.z() / a.wrenches[0].force.z() - 1);
  const ErrorBar bar = error_bar(packed.organ, b.surface);
  EXPECT_FALSE(bar.discretisation_known);
  EXPECT_LE(off, bar.compression);
  EXPECT_LE(bar.compression, 0.1);
  EXPECT_NEAR(bar.total(), bar.resolution + bar.compression + bar.linearity, 1e-15);
  EXPECT_EQ(error_bar(exact.organ, make_surface(exact.organ)).total(), 0.0);
}

}  // namespace
}  // namespace palpate
