// Tips and edges finer than the surface's triangles at any speed: never lost, and no force that their motion
// does not explain.
#include <fmt/core.h>

#include "places_fixture.hpp"

namespace palpate {
namespace {

// Up to 5 mm a tick, towards the surface and along it, over faces and edges: always felt; towards it, its
// force changes by no more than its motion explains. Along it: ANeedlePushedSideways.
TEST_F(Places, AFastTipIsNeverLost) {
  take_needle();
  State slow = make_state(model);
  double k = 0, last = 0;
  for (double d = 0; d <= 5e-3; d += 0.1e-3) {
    const double force = press(slow, Vec3(1e-3, 0.7e-3, -d));
    k = std::max(k, std::abs(force - last) / 0.1e-3), last = force;
  }
  for (const double along : {5e-3, 2.7e-3, 1.1e-3, 0.3e-3}) {
    SCOPED_TRACE(along);
    State state = make_state(model);
    last = 0;
    for (double z = 2.2e-3; z > -5e-3; z -= along) {
      const double force = press(state, Vec3(1e-3, 0.7e-3, z));
      EXPECT_LE(std::abs(force - last), 1.2 * k * along);
      EXPECT_TRUE(force > 1e-3 || z > -0.1e-3) << force;
      last = force;
    }
  }
  for (const double friction : {0.0, 0.3})
    for (const double along : {5e-3, 1e-3, 0.3e-3, 0.1e-3}) {
      SCOPED_TRACE(fmt::format("friction {}, {} mm a tick", friction, 1e3 * along));
      model.settings.friction = friction;
      State state = make_state(model);
      for (int i = 0; i <= 15; ++i) press(state, Vec3(-9e-3, 0.7e-3, -0.1e-3 * i));
      for (double x = -9e-3; x <= 9e-3; x += along) {
        const double force = press(state, Vec3(x, 0.7e-3, -1.5e-3));
        EXPECT_GT(force, 0.02) << x;
        EXPECT_FALSE(state.status & (bad_input | too_many_contacts));
      }
    }
}

// Lying, pushed into the tissue and over it side on; upright, over it: at 1 and 5 m/s its force changes by no
// more than its motion explains, at the stiffness that it shows when it is pressed slowly. Slower, too, less
// deep than where it snaps from node to node (docs/contact.md).
TEST_F(Places, ANeedlePushedSideways) {
  take_needle();
  const Eigen::Quaterniond lying(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitX()));  // along y
  const auto flat = [&](double x, double z) { return at(Vec3(x, 0.7e-3, z + radius), lying); };
  const auto upright = [&](double x, double z) { return tip_at(Vec3(x, 0.7e-3, z)); };
  // Steps along a way; the largest |dF / dx| but for the first.
  const auto stiffest = [&](auto&& input, const Vec3& from, const Vec3& to, double along, double slowly) {
    State state = make_state(model);
    const double depth = -from.z();
    for (int i = 0; i <= 10; ++i)
      step(model, state, input(from.x(), depth > 0 ? -0.1 * depth * i : from.z()));
    Vec3 last = state.wrenches[0].force;
    double most = 0;
    const int ticks = static_cast<int>((to - from).norm() / along + 1e-9);
    for (int i = 1; i <= ticks; ++i) {
      const Vec3 p = from + i * along * (to - from).normalized();
      step(model, state, input(p.x(), p.z()));
      most = std::max(most, (state.wrenches[0].force - last).norm() / along);
      last = state.wrenches[0].force;
      EXPECT_FALSE(state.status & (bad_input | too_many_contacts));
      EXPECT_TRUE(slowly == 0 || most <= 1.2 * slowly) << most / slowly << " at " << 1e3 * p.x() << " mm";
    }
    EXPECT_GT(last.z(), 0.02);
    return most;
  };
  const double k_lying = stiffest(flat, Vec3(1e-3, 0, 0), Vec3(1e-3, 0, -6e-3), 0.1e-3, 0);
  const double k_upright = stiffest(upright, Vec3(1e-3, 0, 0), Vec3(1e-3, 0, -5e-3), 0.1e-3, 0);
  for (const double along : {1e-3, 5e-3}) {
    SCOPED_TRACE(fmt::format("{} mm a tick", 1e3 * along));
    stiffest(flat, Vec3(1e-3, 0, 0.7 * along), Vec3(1e-3, 0, -6e-3), along, k_lying);
    for (const double depth : {1e-3, 1.5e-3}) {
      SCOPED_TRACE(fmt::format("{} mm deep", 1e3 * depth));
      stiffest(flat, Vec3(-9e-3, 0, -depth), Vec3(9e-3, 0, -depth), along, k_lying);
      stiffest(upright, Vec3(-9e-3, 0, -depth), Vec3(9e-3, 0, -depth), along, k_upright);
    }
  }
  for (const double along : {0.3e-3, 0.1e-3, 0.05e-3}) {
    SCOPED_TRACE(fmt::format("{} mm a tick", 1e3 * along));
    stiffest(upright, Vec3(-9e-3, 0, -1e-3), Vec3(9e-3, 0, -1e-3), along, k_upright);
  }
}

// From above the tissue into it in one tick, wholly, wherever it lies between the rows of nodes: each sample
// of a triangle could come round it alone, but not the triangle.
TEST_F(Places, AFastNeedleThatLies) {
  take_needle();
  const Eigen::Quaterniond lying(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitX()));
  for (double x = 0; x < 3e-3; x += 0.31e-3) {
    const auto put = [&](State& state, double z) {
      step(model, state, at(Vec3(x, 0.7e-3, z + radius), lying));
      return state.wrenches[0].force.z();
    };
    State slow = make_state(model), fast = make_state(model);
    for (int k = 0; k <= 15; ++k) put(slow, -0.1e-3 * k);
    put(fast, 3e-3);
    EXPECT_NEAR(put(fast, -1.5e-3), slow.wrenches[0].force.z(), 0.03 * slow.wrenches[0].force.z()) << x;
  }
}

// A blade of 1 mm, edge first: pushed in at up to 5 m/s, and dragged across itself 1 mm deep. Never lost, no
// place is lifted, and its force changes by no more than its motion explains, at the stiffness that it shows
// when it is pressed slowly (with friction: without it slips off ridges).
TEST_F(Places, AFastEdge) {
  const Vec3 half(10e-3, 0.5e-3, 10e-3);
  const Eigen::Quaterniond askew(Eigen::AngleAxisd(0.3, Vec3::UnitZ()));
  take(lattice_of(make_box({-half, half}), 0.25e-3), 1e-3);
  State state = make_state(model);
  const auto change = [&](const Vec3& p) {
    const Vec3 last = state.wrenches[0].force;
    step(model, state, at(p + Vec3(0, 0, half.z()), askew));
    EXPECT_FALSE(state.status & (bad_input | too_many_contacts));
    for (const Contact& c : state.contacts) EXPECT_LT(c.force.z(), 0);
    EXPECT_TRUE(p.z() > -0.2e-3 || state.wrenches[0].force.z() > 0.01) << 1e3 * p.transpose() << " mm";
    return (state.wrenches[0].force - last).norm();
  };
  double k = 0;
  model.settings.friction = 0.3;
  for (double d = 0; d <= 5e-3; d += 0.1e-3) k = std::max(k, change(Vec3(1e-3, 0.7e-3, -d)) / 0.1e-3);
  for (const double friction : {0.0, 0.3}) {
    model.settings.friction = friction;
    for (const double along : {5e-3, 2.7e-3, 1.1e-3}) {
      SCOPED_TRACE(fmt::format("friction {}, {} mm a tick", friction, 1e3 * along));
      state = make_state(model);
      for (double z = 2.2e-3; z > -6e-3; z -= along)
        EXPECT_LE(change(Vec3(1e-3, 0.7e-3, z)), 1.2 * k * along) << 1e3 * z;
    }
    for (const double along : {5e-3, 1e-3, 0.3e-3, 0.1e-3}) {
      SCOPED_TRACE(fmt::format("friction {}, dragged, {} mm a tick", friction, 1e3 * along));
      state = make_state(model);
      for (int i = 0; i <= 10; ++i) change(Vec3(1e-3, -9e-3, -0.1e-3 * i));
      for (double y = -9e-3 + along; y <= 9e-3; y += along)
        EXPECT_LE(change(Vec3(1e-3, y, -1e-3)), 1.2 * k * along) << 1e3 * y;
    }
  }
}

}  // namespace
}  // namespace palpate
