// Thin and fast instruments: nothing is swallowed, nothing tunnels, no side is lost, whatever the speed.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include "fixtures.hpp"

namespace palpate {
namespace {

// 60 x 60 x 30 mm, its base fixed, 3 mm between nodes; its top at z = 0.
Organ slab() {
  return bake(make_block({Vec3(-0.03, -0.03, -0.03), Vec3(0.03, 0.03, 0)}, {20, 20, 10}),
              {{10e3, 0.45, 1000}}, {AnchorHalfSpace{Vec3(0, 0, -0.03), Vec3::UnitZ()}}, 0, {}, nullptr,
              {.order = 1, .pinch = false});
}

struct Thin : ::testing::Test {
  static void SetUpTestSuite() { model.organ = slab(); }
  static void TearDownTestSuite() { model = {}; }
  static inline Model model;

  void take(const Shape& shape) { model.instruments = {{"thin", shape, {}}}; }
  static Shape lattice_box(const Vec3& half, double h) { return lattice_of(make_box({-half, half}), h); }
  // Largest |dF / dx| of a press along -z by steps of 0.1 mm from z = 0 to -depth: the contact's stiffness.
  static double stiffness(double bottom, double depth, const Vec3& aside, const Eigen::Quaterniond& turn) {
    State state = make_state(model);
    double most = 0, last = 0;
    for (double d = 0; d <= depth; d += 0.1e-3) {
      step(model, state, at(aside + Vec3(0, 0, bottom - d), turn));
      const double force = state.wrenches[0].force.norm();
      most = std::max(most, std::abs(force - last) / 0.1e-3);
      last = force;
    }
    return most;
  }
};

// A flat side at 5 m/s and 1 kHz: it would lie beyond the first nodes after one tick. Of a blade of 1 mm and
// a sheet of 0.2 mm.
TEST_F(Thin, AFlatSideAtFiveMetresASecond) {
  const Vec3 blade(10e-3, 10e-3, 0.5e-3), sheet(10e-3, 10e-3, 0.1e-3);
  const std::pair<Shape, double> shapes[] = {
      {Cuboid{blade}, 0.5e-3}, {lattice_box(blade, 0.25e-3), 0.5e-3}, {Cuboid{sheet}, 0.1e-3}};
  for (const auto& [shape, half] : shapes) {
    take(shape);
    const double k = stiffness(half, 0.01, Vec3(0.4e-3, 0.3e-3, 0), Eigen::Quaterniond::Identity());
    for (const double along : {5e-3, 2.7e-3, 1.1e-3, 0.3e-3}) {
      State state = make_state(model);
      double last = 0;
      for (double bottom = 4.2e-3; bottom > -10e-3; bottom -= along) {
        SCOPED_TRACE(
            fmt::format("{} mm a tick, at {} mm, {} mm thick", 1e3 * along, 1e3 * bottom, 2e3 * half));
        step(model, state, at(Vec3(0.4e-3, 0.3e-3, bottom + half)));
        EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
        for (const Contact& c : state.contacts) EXPECT_LT(c.force.z(), 0);  // pushed ahead, never lifted
        const double force = state.wrenches[0].force.z();
        EXPECT_LE(std::abs(force - last), 1.2 * k * along);
        EXPECT_GT(force, bottom < -1e-3 ? 0.1 : -1e-9);
        last = force;
      }
      EXPECT_GT(state.contacts.size(), 30u);
    }
  }
}

// Held 5 mm deep and moved sideways over nodes and away from them, 1 mm a tick: what is under it stays there.
TEST_F(Thin, ADeepBladeSideways) {
  const Vec3 half(10e-3, 10e-3, 0.5e-3);
  take(Cuboid{half});
  const double k = stiffness(half.z(), 0.008, Vec3::Zero(), Eigen::Quaterniond::Identity());
  State state = make_state(model);
  for (double bottom = 1e-3; bottom > -5e-3; bottom -= 0.5e-3)
    step(model, state, at(Vec3(0, 0, bottom + half.z())));
  double last = state.wrenches[0].force.z();
  EXPECT_GT(last, 1);
  for (int tick = 1; tick <= 20; ++tick) {
    SCOPED_TRACE(tick);
    const double x = 1e-3 * (tick <= 10 ? tick : 20 - tick);
    step(model, state, at(Vec3(x, 0, -5e-3 + half.z())));
    EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
    const double force = state.wrenches[0].force.z();
    EXPECT_GT(force, 1);
    EXPECT_LE(std::abs(force - last), 1.2 * k * 1e-3);
    last = force;
    for (const Contact& c : state.contacts) EXPECT_LE(c.force.z(), 1e-9);
  }
}

// A sheet of 0.2 mm stands still in the crater of a ball, 2 mm below where the surface rests. The ball goes
// away, or its grip opens, in one tick: the tissue springs back up to the sheet, and no farther.
TEST_F(Thin, TissueThatSpringsBackMeetsAThinSheet) {
  const double half = 0.1e-3, height = -2e-3;
  model.instruments = {{"ball", Sphere{0.01}, {}}, {"sheet", Cuboid{Vec3(4e-3, 4e-3, half)}, {}}};
  for (const auto& [friction, grips] : {std::pair{0.0, false}, {0.3, false}, {0.0, true}}) {
    SCOPED_TRACE(fmt::format("friction {}, grip {}", friction, grips));
    model.settings.friction = friction;
    State state = make_state(model), late = make_state(model);
    const Surface rest = late.surface;
    Input input = at(Vec3(0.2e-3, 0.1e-3, 0.0101));
    input.instruments.push_back({Eigen::Quaterniond::Identity(), Vec3(0, 0, 0.05)});
    input.grips = {0, 0};
    const auto go = [&] {
      step(model, state, input);
      tick(model, late, input, rest);
      for (std::size_t i = 0; i < 2; ++i) ASSERT_EQ(state.wrenches[i].force, late.wrenches[i].force);
    };
    for (int k = 0; k < 14; ++k) input.instruments[0].translation.z() -= 0.5e-3, go();
    input.instruments[1].translation.z() = height;
    input.grips[0] = grips;
    for (int k = 0; k < 3; ++k) go();
    EXPECT_EQ(state.wrenches[1].force, Vec3::Zero());
    EXPECT_EQ(!state.grasps.empty(), grips);
    input.instruments[0].translation.z() += 0.012;
    input.grips[0] = 0;
    for (int k = 0; k < 3; ++k) {
      go();
      EXPECT_EQ(state.wrenches[0].force, Vec3::Zero());
      EXPECT_GT(state.wrenches[1].force.z(), 0.05);
      EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
      for (const Contact& c : state.contacts) EXPECT_LT(c.force.z(), 0);
      for (const Index node : model.organ.node_of_row) {
        const Vec3& at_rest = model.organ.surface.vertices[static_cast<std::size_t>(node)];
        if (at_rest.z() < 0 || at_rest.head<2>().cwiseAbs().maxCoeff() > 3.5e-3) continue;
        EXPECT_LE(contact_point(model, state, node).z(), height - half + 1e-6);
      }
    }
    input.instruments[1].translation.z() = 0.05;
    go();
    EXPECT_EQ(state.loads.count, 0u);
  }
  model.settings = {};
}

// A flat side under load moves sideways, and the nodes it presses come round its edge: away from a thin
// blade, onto the narrow side of a thick one or free of it. No node is ever pulled, and no force changes by
// more than the motion explains and what the nodes that came round had borne: they leave an edge all at once.
TEST_F(Thin, NodesComeRoundTheEdgeOfALoadedBlade) {
  for (const double thick : {1e-3, 12e-3}) {
    const Vec3 half(6e-3, 6e-3, 0.5 * thick);
    take(Cuboid{half});
    const double k = stiffness(half.z(), 0.008, Vec3::Zero(), Eigen::Quaterniond::Identity());
    for (const double friction : {0.0, 0.3})
      for (const double along : {0.1e-3, 0.5e-3}) {
        SCOPED_TRACE(
            fmt::format("{} mm thick, friction {}, {} mm a tick", 1e3 * thick, friction, 1e3 * along));
        model.settings.friction = friction;
        State state = make_state(model);
        Vec3 origin(-4e-3, 0.4e-3, 0);
        for (double bottom = 0.1e-3; bottom > -3e-3; bottom -= 0.1e-3)
          origin.z() = bottom + half.z(), step(model, state, at(origin));
        const auto forces = [&] {
          std::vector<Vec3> out(model.organ.surface_size(), Vec3::Zero());
          for (const Contact& c : state.contacts) out[static_cast<std::size_t>(c.node)] = c.force;
          return out;
        };
        Vec3 last = state.wrenches[0].force;
        std::vector<Vec3> before = forces();
        std::size_t came_off = 0, sideways = 0;
        for (double moved = along; moved < 8e-3; moved += along) {
          origin.x() += along;
          step(model, state, at(origin));
          EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
          for (const Contact& c : state.contacts) {
            const Gap g = gap(Cuboid{half}, c.point - origin);
            EXPECT_NEAR(g.distance, 0, 1e-6);
            EXPECT_GE(c.force.dot(g.normal), 0.95 * c.force.norm());
            EXPECT_LE(g.normal.z(), 1e-6);  // never lifted
            sideways += g.normal.z() > -0.5;
          }
          const std::vector<Vec3> now = forces();
          double lost = 0;
          for (std::size_t n = 0; n < now.size(); ++n)
            if (before[n].dot(now[n]) < 0.5 * before[n].norm() * now[n].norm() || now[n] == Vec3::Zero())
              lost += before[n].norm(), came_off += before[n] != Vec3::Zero();
          const double explained = 1.2 * k * along + lost;
          EXPECT_LE((state.wrenches[0].force - last).norm(), explained);
          for (std::size_t n = 0; n < now.size(); ++n) EXPECT_LE((now[n] - before[n]).norm(), explained);
          last = state.wrenches[0].force, before = now;
        }
        EXPECT_GT(came_off, 3u);
        EXPECT_EQ(sideways > 0, thick > 5e-3);
      }
  }
  model.settings = {};
}

// T 7.2 point 3: beyond the middle of a thin body its far side is nearer, and the body is swallowed. In steps
// shorter than it is thick, in longer ones, at once; and back again. Nodes that come round its edge on the
// way down are lifted when it goes back, those within are not.
TEST_F(Thin, TheThesisSwallowing) {
  const double half = 0.5e-3, top = 0.6e-3, deepest = -9e-3;
  take(Cuboid{Vec3(10e-3, 10e-3, half)});
  for (const int ticks : {12, 3, 1}) {
    State state = make_state(model);
    const auto go = [&](int k, double within) {
      SCOPED_TRACE(fmt::format("{} of {} ticks", k, ticks));
      const double height = top + (deepest - top) * k / ticks;
      step(model, state, at(Vec3(0, 0, height)));
      EXPECT_TRUE(k < ticks || state.wrenches[0].force.z() > 1);
      for (const Index node : model.organ.node_of_row) {
        const Vec3& rest = model.organ.surface.vertices[static_cast<std::size_t>(node)];
        if (rest.z() < 0 || rest.head<2>().cwiseAbs().maxCoeff() > within) continue;
        EXPECT_LE(deformed(model, state, node).z(), height - half + 1e-6);  // under it, not on it
        for (const Contact& c : state.contacts) EXPECT_TRUE(c.node != node || c.force.z() < 0);
      }
    };
    for (int k = 0; k <= ticks; ++k) go(k, 9e-3);
    for (int k = ticks - 1; k >= 0; --k) go(k, 8e-3);
    step(model, state, at(Vec3(0, 0, 0.05)));  // more than a quarter of the organ: it was not on the way
    EXPECT_TRUE(state.contacts.empty());
  }
}

// Instruments that are put somewhere have no way: they appear in the tissue, which goes to the nearest side.
TEST_F(Thin, AJumpIsNoMotion) {
  take(Cuboid{Vec3(5e-3, 5e-3, 0.5e-3)});
  State state = make_state(model), fresh = make_state(model);
  step(model, state, at(Vec3(0, 0, 0.04)));
  EXPECT_EQ(state.status, status_ok);
  step(model, state, at(Vec3(0, 0, -0.2e-3)));
  EXPECT_NE(state.status & jumped, 0u);
  step(model, fresh, at(Vec3(0, 0, -0.2e-3)));
  EXPECT_EQ(fresh.status & jumped, 0u);
  EXPECT_EQ(state.wrenches[0].force, fresh.wrenches[0].force);
}

// A tick that was skipped is no end of a way.
TEST_F(Thin, BadInputKeepsTheWay) {
  take(Cuboid{Vec3(5e-3, 5e-3, 0.5e-3)});
  State state = make_state(model);
  step(model, state, at(Vec3(0, 0, 3e-3)));
  step(model, state, at(Vec3(0, 0, std::nan(""))));
  step(model, state, at(Vec3(0, 0, -3e-3)));
  EXPECT_GT(state.wrenches[0].force.z(), 0.1);
}

}  // namespace
}  // namespace palpate
