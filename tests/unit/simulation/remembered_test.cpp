// How far a node was from an instrument is remembered from tick to tick: nothing may come near unseen.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "fixtures.hpp"
#include "palpate/simulation/tick_work.hpp"

namespace palpate {
namespace {

// Two instruments that press, roll and cross each other, the second a ball; `seed` says how.
class Crossing {
 public:
  explicit Crossing(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> share(-1, 1);
    for (double& x : f_) x = share(random);
  }
  Input at(int k) const {
    const double t = 0.03 * k * (1 + 0.8 * f_[0]);
    const Eigen::Quaterniond turn =
        Eigen::AngleAxisd(f_[2] * t, Vec3::UnitY()) *
        Eigen::Quaterniond(Eigen::AngleAxisd(1.5 * f_[1] + 0.5 * std::sin(t * 2), Vec3::UnitX()));
    const Vec3 first(0.02 * std::sin(t + f_[3] * 6), 0.03 * f_[4] + 0.015 * std::sin(1.7 * t),
                     0.113 + 0.015 * std::cos(2.3 * t + f_[5]) - 0.008 * std::min(1.0, 0.05 * k));
    const Vec3 second(0.03 * f_[6], 0.02 * std::sin(t * 1.3), 0.116 + 0.008 * std::cos(3 * t));
    return {0, {}, {Pose{turn, first}, Pose{Eigen::Quaterniond::Identity(), second}}};
  }

 private:
  double f_[8];
};

// Of all nodes that can move, where the loads bring them, from the instruments: the least, m.
double least_distance(const Model& model, const State& state, const Input& input, Deformer& deformer,
                      Surface& surface) {
  deformer(model.organ, state.loads, surface);
  double least = 1;
  for (std::size_t i = 0; i < model.instruments.size(); ++i) {
    const PlacedShape shape(model.instruments[i].shape, input.instruments[i]);
    for (const Index node : model.organ.node_of_row)
      least = std::min(least, shape.distance(surface.positions[static_cast<std::size_t>(node)]));
  }
  return least;
}

// With friction and two balls a node is squeezed between both, which pull it both ways (seed 1, tick 88); a
// narrow band's distances jump (seed 4).
TEST(Remembered, WhatTwoInstrumentsReachIsSeenHoweverOldTheSurface) {
  const TriangleMesh bar = make_box({Vec3(-0.02, -0.004, -0.003), Vec3(0.02, 0.004, 0.003)});
  const auto narrow = std::make_shared<const BandLattice>(sample_band(
      SignedDistanceField(bar), make_grid_spaced(bounding_box(bar.vertices), 0.8e-3, 6.4e-3), 0.8e-3));
  for (const unsigned seed : {1u, 4u}) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    Model model = block_model(8, seed == 1 ? Shape(Sphere{0.015}) : Shape(narrow));
    model.instruments.push_back({"ball", Sphere{0.012}, {}});
    model.settings.friction = seed == 1 ? 0.4 : 0;
    const Crossing crossing(seed);
    State state = make_state(model), late = make_state(model);
    Surface old = late.surface, now = old;
    Deformer deformer(model.organ);
    std::size_t touched = 0;
    for (int k = 0; k < 120; ++k) {
      const Input input = crossing.at(k);
      step(model, state, input);
      tick(model, late, input, old);
      if (k % 2 == 0) deformer(model.organ, late.loads, old);
      for (std::size_t i = 0; i < 2; ++i)
        ASSERT_EQ(std::memcmp(&state.wrenches[i], &late.wrenches[i], sizeof(Wrench)), 0) << k;
      touched += state.contacts.size();
      // Beyond the band a distance says little of how near what is seen is.
      if (!(state.status & not_converged)) {
        ASSERT_GT(least_distance(model, state, input, deformer, now), -1e-6) << k;
      }
    }
    EXPECT_GT(touched, 200u);
  }
}

// At the rim of a narrow band, and about the grid, distances jump: what they say there must not decide which
// nodes are points.
TEST(Remembered, WhichNodesArePointsIsTheSameHoweverOldTheSurface) {
  const TriangleMesh bar = make_box({Vec3(-0.02, -0.004, -0.003), Vec3(0.02, 0.004, 0.003)});
  const auto narrow = std::make_shared<const BandLattice>(sample_band(
      SignedDistanceField(bar), make_grid_spaced(bounding_box(bar.vertices), 0.8e-3, 8.8e-3), 0.8e-3));
  struct Case {
    int nodes, first, last, lag;
    double friction;
  };
  for (const Case& c : {Case{16, 600, 760, 13, 0.0}, Case{12, 1330, 1400, 7, 0.3}}) {
    Model model = block_model(c.nodes, Shape(narrow));
    model.settings.friction = c.friction;
    State state = make_state(model), late = make_state(model);
    Surface old = late.surface;
    Deformer deformer(model.organ);
    const auto points_of = [](const State& s) {
      std::vector<std::pair<Index, Index>> points;
      for (const ContactPoint& p : s.scratch->points) points.push_back({p.instrument, p.node});
      return points;
    };
    std::size_t points = 0;
    for (int k = c.first; k < c.last; ++k) {
      const double t = 0.1 * k;
      const Input input =
          at(Vec3(0.02 * std::sin(t), 0.015 * std::sin(1.7 * t), 0.104 + 0.004 * std::cos(2.3 * t)),
             Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * std::sin(2 * t), Vec3::UnitX())));
      step(model, state, input);
      tick(model, late, input, old);
      if (k % c.lag == 0) deformer(model.organ, late.loads, old);
      ASSERT_EQ(points_of(state), points_of(late)) << c.nodes << ' ' << k;
      points += state.scratch->points.size();
    }
    EXPECT_GT(points, 100u);
  }
}

// A dented surface is not where the loads bring it.
TEST(Remembered, AnInstrumentThatStandsInADentOfItsOwnIsFelt) {
  Model model = block_model(8, lattice_of(make_sphere(Vec3::Zero(), 0.02, 48, 96), 0.0025), Mode::imprint);
  State state = make_state(model);
  const auto deep = [](double depth) { return at(Vec3(0, 0, 0.12 - depth)); };
  for (int k = 1; k <= 10; ++k) step(model, state, deep(0.6e-3 * k));
  for (int k = 0; k < 3; ++k) step(model, state, deep(3e-3));
  model.settings.mode = Mode::unilateral;
  for (int k = 0; k < 5; ++k) step(model, state, deep(3e-3));
  EXPECT_GT(state.wrenches[0].force.z(), 0.1);
  EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
}

// What the other modes leave of forces and displacements is no beginning for a solver.
TEST(Remembered, NothingOfAnotherMode) {
  Model model = block_model(8, lattice_of(make_sphere(Vec3::Zero(), 0.02, 48, 96), 0.0025));
  const auto deep = [](double depth) { return at(Vec3(0, 0, 0.12 - depth)); };
  State fresh = make_state(model);
  step(model, fresh, deep(10e-3));
  ASSERT_GT(fresh.contacts.size(), 3u);
  for (const Mode other : {Mode::imprint, Mode::gaussian, Mode::prescribed}) {
    SCOPED_TRACE(name(other));
    State state = make_state(model);
    for (int k = 1; k <= 10; ++k) step(model, state, deep(1.2e-3 * k));
    model.settings.mode = other;
    for (int k = 0; k < 3; ++k) step(model, state, deep(12e-3));
    model.settings.mode = Mode::unilateral;
    step(model, state, deep(10e-3));
    EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
    EXPECT_LT((state.wrenches[0].force - fresh.wrenches[0].force).norm(),
              1e-3 * fresh.wrenches[0].force.norm());
    for (const Contact& c : state.contacts) {
      const Vec3& now = state.surface.positions[static_cast<std::size_t>(c.node)];
      EXPECT_NEAR(distance(model.instruments[0].shape, deep(10e-3).instruments[0].inverse() * now),
                  c.gap_after, 5e-9);
    }
  }
}

}  // namespace
}  // namespace palpate
