#include <gtest/gtest.h>

#include "fixtures.hpp"

namespace palpate {
namespace {

// A block whose top a flat plate touches (the half-space turned upside down), E 10 kPa, nu 0.45.
Model plate(double mu, int order = 1, int cells = 6) {
  Model model = block_model(cells, HalfSpace{}, Mode::unilateral, order);
  model.settings.friction = mu;
  return model;
}
const Eigen::Quaterniond down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));

// The law at every contact, from the outside: inside the cone, and against the slip where on it.
void expect_coulomb(const Model& model, const State& state, const Input& input, double slack = 1e-3) {
  ASSERT_EQ(state.status & not_converged, 0u);
  double peak = 0;
  for (const Contact& c : state.contacts) peak = std::max(peak, c.force.norm());
  for (const Contact& c : state.contacts) {
    const auto i = static_cast<std::size_t>(c.instrument);
    const Vec3 x = contact_point(model, state, c.node);
    const Vec3 n = input.instruments[i].rotation *
                   gap(model.instruments[i].shape, input.instruments[i].inverse() * x).normal;
    const double pressure = c.force.dot(n);
    EXPECT_GT(pressure, 0);
    EXPECT_LE((c.force - pressure * n).norm(), model.settings.friction * pressure + slack * peak);
  }
}

// Wholly sliding: the ratio of the forces is mu, against the motion.
TEST(Friction, APlateDraggedSideways) {
  for (const int order : {1, 2})
    for (const double mu : {0.1, 0.3, 0.8}) {
      const Model model = plate(mu, order);
      State state = make_state(model);
      for (int k = 0; k <= 400; ++k) {
        const double depth = 0.002 * std::min(1.0, k / 50.0), along = k < 50 ? 0 : 1e-4 * (k - 50);
        const Input input = at(Vec3(along, 0.5 * along, 0.1 - depth), down);
        step(model, state, input);
        expect_coulomb(model, state, input);
      }
      const Vec3 f = state.wrenches[0].force;
      EXPECT_GT(f.z(), 1);
      const Vec3 side(f.x(), f.y(), 0);
      EXPECT_NEAR(side.norm() / f.z(), mu, 0.01 * mu) << order << ' ' << mu;
      EXPECT_LT(side.normalized().dot(Vec3(1, 0.5, 0).normalized()), -0.99);  // on the instrument, against it
    }
}

// Pressed and held with a sideways load below the limit: nothing moves, for as long as it is held.
TEST(Friction, SticksWithoutDrift) {
  const Model model = plate(0.6, 1, 4);
  State state = make_state(model);
  const auto input_at_tick = [](int k) {
    return at(
        Vec3(3e-4 * std::min(1.0, std::max(0, k - 50) / 50.0), 0, 0.1 - 0.002 * std::min(1.0, k / 50.0)),
        down);
  };
  for (int k = 0; k < 200; ++k) step(model, state, input_at_tick(k));
  const Vec3 force = state.wrenches[0].force;
  const std::vector<Vec3f> held = state.surface.displacement;
  EXPECT_LT(force.x(), -0.1);
  for (int k = 0; k < 100000; ++k) tick(model, state, input_at_tick(1000), state.surface);
  step(model, state, input_at_tick(1000));
  EXPECT_LT((state.wrenches[0].force - force).norm(), 1e-6 * force.norm());
  for (std::size_t i = 0; i < held.size(); ++i)
    EXPECT_LT((state.surface.displacement[i] - held[i]).norm(), 1e-6f * 0.17f);
  // It goes back with the plate; nodes at the rim have slipped.
  const Vec3 back = [&] {
    for (int k = 0; k < 50; ++k) step(model, state, at(Vec3(3e-4 * (1 - (k + 1) / 50.0), 0, 0.098), down));
    return state.wrenches[0].force;
  }();
  EXPECT_LT(std::abs(back.x()), 0.6 * std::abs(force.x()));
}

// A block let down onto an inclined plane by its anchor's frame, its weight straight down whatever the plane
// answers: it stays where tan(theta) < mu, and slides down where it is larger.
TEST(Friction, ABlockOnAnInclinedPlane) {
  const double mu = 0.5, weight = 2;
  for (const double slope : {0.40, 0.47, 0.53, 0.60}) {
    Model model = plate(mu, 1, 4);
    const double theta = std::atan(slope);
    const Eigen::Quaterniond tilt(Eigen::AngleAxisd(theta, Vec3::UnitY()));  // downhill: +x
    const Vec3 normal = tilt * Vec3::UnitZ();
    State state = make_state(model);
    Input input;
    input.instruments.resize(1);
    input.instruments[0].rotation = tilt;  // through the world's origin
    // The block's free top lies on the plane: turned over, then tilted with it.
    input.organ.rotation = tilt * down;
    Vec3 anchor = 0.1005 * normal, last = anchor;
    double moved = 0;
    for (int k = 0; k < 3000; ++k) {
      input.organ.translation = anchor;
      step(model, state, input);
      const Vec3 from_plane = -state.wrenches[0].force;  // on the block
      const Vec3 push = from_plane + Vec3(0, 0, -weight);
      anchor += 4e-5 * push;  // m/N: less than the block's own compliance, so it creeps to rest
      if (k == 2000) last = anchor;
    }
    moved = (anchor - last).norm();
    if (slope < mu) {
      EXPECT_LT(moved, 1e-6) << slope;
      EXPECT_NEAR(-state.wrenches[0].force.z(), weight, 1e-3 * weight) << slope;
    } else {
      EXPECT_GT(moved, 1e-4) << slope;
      EXPECT_GT((anchor - last).dot(tilt * Vec3::UnitX()), 0.99 * moved) << slope;
    }
  }
}

TEST(Friction, NoneIsTheOldLawAndMuchIsGlue) {
  const Input above = at(Vec3(0, 0, 0.12)), in = at(Vec3(0, 0, 0.115)), aside = at(Vec3(0.003, 0, 0.115));
  std::vector<double> side, whole;
  for (const double mu : {0.0, 1e-9, 0.2, 5.0}) {
    Model model = block_model(10, Sphere{0.02});
    model.settings.friction = mu;
    State state = make_state(model);
    for (const Input& input : {above, in, in, aside, aside}) {
      step(model, state, input);
      EXPECT_EQ(state.status & ~strain_beyond_linear, 0u) << mu;
    }
    side.push_back(-state.wrenches[0].force.x());
    whole.push_back(state.wrenches[0].force.norm());
  }
  EXPECT_NEAR(side[1], side[0], 1e-3 * whole[0]);  // directions are right to 1e-3
  EXPECT_GT(side[2], side[0] + 0.05);
  EXPECT_GT(side[3], side[2]);
}

// A tick's work is bounded: one turn says that it is not enough, the next ticks go on from there.
TEST(Friction, ALimitIsAStatusAndTheNextTicksGoOn) {
  Model model = block_model(10, Sphere{0.02});
  model.settings.friction = 0.4;
  State exact = make_state(model);
  model.settings.max_relinearisations = 1;
  State state = make_state(model);
  int not_yet = 0;
  for (int k = 0; k < 12; ++k) {
    const Input input = at(Vec3(1e-3 * k, 0.002, 0.12 - 1e-3 * std::min(k, 8)));
    step(model, state, input);
    EXPECT_LE(state.relinearisations, 1);
    not_yet += (state.status & not_converged) != 0;
    model.settings.max_relinearisations = 100;
    step(model, exact, input);
    model.settings.max_relinearisations = 1;
  }
  EXPECT_GT(not_yet, 6);
  const Input still = at(Vec3(11e-3, 0.002, 0.112));
  int ticks = 0;
  do {
    step(model, state, still);
  } while (state.status & not_converged && ++ticks < 40);
  EXPECT_LT(ticks, 40);
  expect_coulomb(model, state, still);
  EXPECT_LT((state.wrenches[0].force - exact.wrenches[0].force).norm(), 0.3 * exact.wrenches[0].force.norm());
}

// A tick begins with the forces that the last two lead to: while an instrument goes on as it went, one turn
// does, with friction and without. (Two to four from the last tick's forces.)
TEST(Friction, OneTurnATickWhileAMotionGoesOn) {
  for (const double mu : {0.0, 0.3}) {
    Model model = block_model(14, Sphere{0.03});
    model.settings.friction = mu;
    State state = make_state(model);
    int turns = 0;
    for (int k = 0; k < 260; ++k) {
      const double x = 1e-4 * std::max(0, k - 100);
      step(model, state, at(Vec3(-0.008 + x, 0, 0.1 + 0.03 - 5e-5 * std::min(k, 100))));
      EXPECT_EQ(state.status & not_converged, 0u) << k;
      if (k >= 120) turns += state.relinearisations;
    }
    EXPECT_GT(state.contacts.size(), 8u);
    EXPECT_LT(turns, 140 * 1.5) << mu;
  }
}

TEST(Friction, OldSurfacesGiveTheSameBits) {
  Model model = block_model(10, Sphere{0.02});
  model.settings.friction = 0.4;
  State fresh = make_state(model), late = make_state(model);
  Surface old = late.surface;
  Deformer deformer(model.organ);
  for (int k = 0; k < 150; ++k) {
    const Input input = at(Vec3(-0.02 + 2.5e-4 * k, 0.002, 0.121 - 0.01 * std::min(1.0, k / 40.0)));
    step(model, fresh, input);
    tick(model, late, input, old);
    if (k % 12 == 0) deformer(model.organ, late.loads, old);
    ASSERT_EQ(fresh.wrenches[0].force, late.wrenches[0].force) << k;
    ASSERT_EQ(fresh.status & ~strain_beyond_linear, 0u) << k;
  }
}

}  // namespace
}  // namespace palpate
