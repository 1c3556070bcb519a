// What a hand feels of a grip, by a device whose button closes it.
#include <gtest/gtest.h>

#include "loop.hpp"
#include "motion_file.hpp"

namespace palpate {
namespace {

// Pressed in by 6 mm in the first second, gripped, lifted to 14 mm above it, held, let go.
TEST(HapticGrip, PullsTheHandAndRests) {
  const MotionText file("time,hand.z,hand.grip\n0,0.131,0\n1,0.124,1\n3,0.138,1\n5,0.138,0\n6,0.138,0\n");
  for (const char* driver : {"replay", "loopback"}) {
    const auto device = open_device(file.device(driver));
    ForceLoop loop(block_model(8, Sphere{0.03}));
    double work = 0, least = 0, most = -1e9;  // J, of the hand; N while it is held
    Vec3 last = Vec3::Zero(), felt = Vec3::Zero();
    for (int i = 0; i < 5990; ++i) {
      const Vec3 before = felt;
      felt = loop.tick(*device).force;
      if (i > 0) work -= before.dot(loop.sample.pose.translation - last);
      last = loop.sample.pose.translation;
      EXPECT_EQ(loop.state.status & ~strain_beyond_linear, 0u);
      EXPECT_EQ(loop.sample.buttons, i >= 1000 && i < 5000 ? 1u : 0u) << i;
      EXPECT_EQ(!loop.state.grasps.empty(), loop.sample.buttons != 0) << i;
      if (i > 4500 && i < 5000) least = std::min(least, felt.z()), most = std::max(most, felt.z());
    }
    EXPECT_LT(most, -0.1) << driver;  // down
    EXPECT_LT(most - least, 1e-6) << driver;
    EXPECT_EQ(felt, Vec3::Zero()) << driver;
    EXPECT_GT(work, 1e-4) << driver;  // what was stretched is lost when it is let go
  }
}

}  // namespace
}  // namespace palpate
