// Ticks on surfaces that lag behind, as in the force loop.
#include <gtest/gtest.h>

#include "fixtures.hpp"

namespace palpate {
namespace {

void expect_same(const State& a, const State& b, int k) {
  ASSERT_EQ(a.status & ~strain_beyond_linear, b.status & ~strain_beyond_linear) << k;  // a tick has none
  ASSERT_EQ(a.contacts.size(), b.contacts.size()) << k;
  for (std::size_t i = 0; i < a.contacts.size(); ++i) {
    ASSERT_EQ(a.contacts[i].node, b.contacts[i].node) << k;
    ASSERT_EQ(a.contacts[i].force, b.contacts[i].force) << k;
    ASSERT_EQ(a.contacts[i].gap_after, b.contacts[i].gap_after) << k;
  }
  for (std::size_t i = 0; i < a.wrenches.size(); ++i)
    ASSERT_EQ(a.wrenches[i].force, b.wrenches[i].force) << k;
  ASSERT_EQ(a.deepest_after, b.deepest_after) << k;
}

// Pressed in, dragged over two thirds of the organ, with a jump on the way, and out.
Input input_of(int k) {
  const double t = k / 199.0, depth = 0.012 * std::min({1.0, 5 * t, 5 * (1 - t)}) - 0.001;
  const double jump = k >= 120 ? 0.008 : 0;
  return at(Vec3(-0.03 + 0.05 * t + jump, 0.003 + 0.01 * std::sin(9 * t), 0.1 + 0.02 - depth),
            Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * t, Vec3(0.3, 1, 0.2).normalized())));
}

TEST(Tick, AnOldSurfaceGivesTheSameBits) {
  const Shape shapes[] = {Shape{Sphere{0.02}},
                          lattice_of(make_box({Vec3(-0.02, -0.02, -0.02), Vec3(0.02, 0.02, 0.02)}, 1), 2e-3)};
  for (const Storage storage : {Storage::dense, Storage::half, Storage::hierarchical})
    for (const Shape& shape : shapes) {
      Model model;
      model.organ = block_organ(12, {storage == Storage::half ? 2 : 1, storage, 1e-3, 0, {}, {}, false});
      model.instruments.push_back({"tool", shape, surface_of_primitive(shape)});
      for (const int lag : {1, 7, 40}) {
        State fresh = make_state(model), late = make_state(model);
        Surface old = late.surface, coming = late.surface;
        Deformer deformer(model.organ);
        std::size_t most = 0;
        for (int k = 0; k < 200; ++k) {
          const Input input = input_of(k);
          step(model, fresh, input);
          if (k % lag == 0) {  // what the other thread finished in the meantime
            std::swap(old, coming);
            deformer(model.organ, late.loads, coming);
          }
          tick(model, late, input, old);
          ASSERT_NO_FATAL_FAILURE(expect_same(fresh, late, k)) << storage_name(storage) << " lag " << lag;
          most = std::max(most, late.contacts.size());
        }
        EXPECT_GT(most, 6u);
        deformer(model.organ, late.loads, coming);
        EXPECT_EQ(coming.displacement, fresh.surface.displacement);
      }
    }
}

// The bound holds: no node moves farther than its softness times the drift.
TEST(Tick, SoftnessBoundsWhatForcesDo) {
  const Organ organ = block_organ(6);
  const Surface rest = make_surface(organ);
  std::vector<float> softness(organ.surface_size(), 0);
  for (std::size_t i = 0; i < rest.clusters->nodes.size(); ++i)
    softness[static_cast<std::size_t>(rest.clusters->nodes[i])] = rest.clusters->softness[i];
  Surface surface = rest;
  Deformer deformer(organ);
  std::srand(3);
  double tightest = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Loads loads(organ.surface_size());
    loads.u_known = false;
    loads.number = static_cast<std::uint64_t>(trial + 1);
    for (Index r = trial % 5; r < static_cast<Index>(organ.compliance.nodes());
         r += 1 + std::rand() % (1 + 4 * trial))
      loads.rows[loads.count] = r, loads.forces[loads.count++] = Vec3::Random();
    deformer(organ, loads, surface);
    double work = 0;
    for (std::size_t i = 0; i < loads.count; ++i)
      work += loads.forces[i].dot(
          surface
              .reading[static_cast<std::size_t>(organ.node_of_row[static_cast<std::size_t>(loads.rows[i])])]
              .cast<double>());
    for (std::size_t n = 0; n < softness.size(); ++n) {
      const double bound = static_cast<double>(softness[n]) * std::sqrt(work);
      EXPECT_LE(surface.reading[n].norm(), bound * 1.0001 + 1e-9);
      if (bound > 0) tightest = std::max(tightest, static_cast<double>(surface.reading[n].norm()) / bound);
    }
  }
  EXPECT_GT(tightest, 0.5);  // it is not idle
}

}  // namespace
}  // namespace palpate
