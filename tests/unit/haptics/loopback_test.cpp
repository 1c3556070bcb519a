// The simulated hand alone, and pressing on stone for a minute.
#include <gtest/gtest.h>

#include "loop.hpp"
#include "motion_file.hpp"
#include "palpate/simulation/loop.hpp"

namespace palpate {
namespace {

TEST(Loopback, IsAMassOnASpring) {
  const MotionText file("time,hand.x\n0,0\n1,0\n");
  const auto device = open_device(file.device("loopback", ",mass=0.2,stiffness=300,damping=1,friction=0.5"));
  const double m = 0.2, k = 300, d = 1.5, force = 2;
  const double decay = d / (2 * m), omega = std::sqrt(k / m - decay * decay);
  for (int i = 0; i <= 400; ++i) {
    const double t = 1e-3 * i;
    const double x =
        force / k * (1 - std::exp(-decay * t) * (std::cos(omega * t) + decay / omega * std::sin(omega * t)));
    const DeviceSample s = device->read();
    EXPECT_TRUE(s.connected);
    EXPECT_NEAR(s.pose.translation.x(), x, 2e-4 * force / k * (1 + i)) << i;
    device->write({Vec3(force, 0, 0), Vec3::Zero()});
  }
  device->write({Vec3::Constant(std::nan("")), Vec3::Zero()});
  EXPECT_TRUE(device->read().pose.translation.allFinite());
}

struct Swing {
  double least = 1e9, most = -1e9;
  void add(double x) { least = std::min(least, x), most = std::max(most, x); }
  double size() const { return most - least; }
};

// A minute of pressing on the pillar of stone; after half of it a tap of 5 mm. Before and after, once the
// hand is at rest, nothing swings.
TEST(Loopback, PressesOnStoneWithoutOscillation) {
  const MotionText file(
      "time,hand.x,hand.y,hand.z\n"
      "0,0.001,0.002,0.125\n"
      "0.2,0.001,0.002,0.125\n"
      "1,0.001,0.002,0.105\n"
      "30,0.001,0.002,0.105\n"
      "30.005,0.001,0.002,0.100\n"
      "30.05,0.001,0.002,0.100\n"
      "30.055,0.001,0.002,0.105\n"
      "60,0.001,0.002,0.105\n");
  for (const double young : {1e6, 4e6, 1.5e7})
    for (const char* hand : {"", ",mass=0.05,stiffness=1000,damping=0.5,friction=0.1"}) {
      const auto device = open_device(file.device("loopback", hand));
      ForceLoop loop(pillar_model(young));
      Swing force, height, tap;
      double stiffness = 0, last = 0, height_before = 0;
      for (int i = 0; i < 60000; ++i) {
        const double time = 1e-3 * i, felt = loop.tick(*device).force.norm();
        if (time > 30 && time < 30.2) tap.add(felt);
        const double z = loop.coupling.instrument.translation.z(), pressed = loop.state.wrenches[0].force.z();
        if (time < 1 && last > 0.5 && height_before - z > 2e-6)  // while it goes in
          stiffness = std::max(stiffness, (pressed - last) / (height_before - z));
        last = pressed, height_before = z;
        if ((time > 5 && time < 30) || time > 35)
          force.add(felt), height.add(loop.sample.pose.translation.z());
        ASSERT_EQ(loop.state.status & ~not_converged, 0u);
      }
      std::cout << "contact " << stiffness << " N/m, " << force.most << " N; swings by " << force.size()
                << " N, " << height.size() << " m; tap " << tap.least << " to " << tap.most << " N\n";
      EXPECT_GT(stiffness, 5000);
      EXPECT_GT(force.least, 1);
      EXPECT_LT(force.size(), 1e-3);
      EXPECT_LT(height.size(), 1e-6);
      EXPECT_GT(tap.size(), 0.5);
    }
}

// The same for some seconds in the loop's threads, where the surface lags behind: the hand feels what it does
// step by step, bit for bit.
TEST(Loopback, PressesOnStoneInTheForceLoop) {
  const MotionText file(
      "time,hand.x,hand.y,hand.z\n"
      "0,0.001,0.002,0.125\n"
      "0.2,0.001,0.002,0.125\n"
      "1,0.001,0.002,0.105\n"
      "5,0.001,0.002,0.105\n");
  const auto device = open_device(file.device("loopback")), other = open_device(file.device("loopback"));
  ForceLoop loop(pillar_model()), stepped(loop.model);
  std::vector<double> felt;
  felt.reserve(5000);
  Swing force, height;
  std::uint32_t status = 0;
  LoopHooks hooks;
  hooks.input = [&](std::uint64_t, const State&, Input& input) {
    loop.lead(*device);
    input = loop.input;
    return true;
  };
  hooks.output = [&](std::uint64_t k, const Input&, const State& state) {
    felt.push_back(loop.feel(*device).force.norm());
    if (k > 3000) force.add(felt.back()), height.add(loop.sample.pose.translation.z());
    status |= state.status;
  };
  LoopSettings settings;
  settings.rate = 0, settings.ticks = 5000, settings.frame_rate = 300;
  run_loop(loop.model, loop.state, settings, hooks);
  EXPECT_EQ(status & ~not_converged, 0u);
  EXPECT_GT(force.least, 1);
  EXPECT_LT(force.size(), 1e-3);
  EXPECT_LT(height.size(), 1e-6);
  ASSERT_EQ(felt.size(), 5000u);
  for (const double f : felt) ASSERT_EQ(stepped.tick(*other).force.norm(), f);
}

}  // namespace
}  // namespace palpate
