// Devices by name; the replayed motion.
#include "palpate/haptics/device.hpp"

#include <gtest/gtest.h>

#include "motion_file.hpp"
#include "palpate/base/error.hpp"

namespace palpate {
namespace {

std::string message(const std::string& spec, ErrorKind kind) {
  try {
    open_device(spec);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind) << error.what();
    return error.what();
  }
  ADD_FAILURE() << spec << " opened";
  return "";
}

const std::string two_tools =
    "# a comment\n"
    "time, organ.x, needle.x, tip.x, tip.y, tip.qw, tip.qz\n"
    "1, 9, 5, 0.10, 0, 1, 0\n"
    "1.01, 9, 5, 0.20, -0.04, 0.70710678118654757, 0.70710678118654757\n"
    "1.02, 9, 6, 0.20, -0.04, 0.70710678118654757, 0.70710678118654757\n";

TEST(Device, NamesAndSettings) {
  for (const char* spec : {"", "phantom", ":x", "replayer:x", "Replay:x"}) {
    const std::string text = message(spec, ErrorKind::usage);
    for (const Driver& driver : drivers()) EXPECT_NE(text.find(driver.usage), std::string::npos) << text;
  }
  EXPECT_GE(drivers().size(), 2u);
  const MotionText file(two_tools);
  EXPECT_NE(message(file.device("replay", ",speed=2"), ErrorKind::usage).find("there are: tick"),
            std::string::npos);
  EXPECT_NE(message(file.device("replay", ",tick=fast"), ErrorKind::usage).find("'tick=fast'"),
            std::string::npos);
  message(file.device("replay", ",tick=0"), ErrorKind::usage);
  message(file.device("loopback", ",mass=-1"), ErrorKind::usage);
  message(file.device("loopback", ",mass=nan"), ErrorKind::usage);
  message("replay", ErrorKind::usage);
  message("loopback:", ErrorKind::usage);
  message("replay:/nowhere/hand.csv", ErrorKind::file);
  message(file.device("replay", "#forceps"), ErrorKind::format);
}

TEST(Device, MotionsThatAreWrongSayWhere) {
  const auto says = [](const std::string& text, const std::string& part) {
    const MotionText file(text);
    for (const char* driver : {"replay", "loopback"}) {
      const std::string what = message(file.device(driver), ErrorKind::format);
      EXPECT_NE(what.find(part), std::string::npos) << what;
    }
  };
  says("", "no instrument");
  says("time\n0\n", "no instrument");
  says("time,organ.x\n0,0\n", "no instrument");
  says("time,tip.x\n", "no poses");
  says("time,tip.x\n0,0\n0.1,zero\n", ".csv:3");
  says("time,tip.x\n0,0\n0.1,nan\n", ".csv:3");
  says("time,tip.x\n0,0\n0.1\n", ".csv:3");
  says("time,tip.x\n0,0\n0,1\n", ".csv:3");
  says("time,tip.x,tip.speed\n0,0,0\n", ".csv:1");
  says("time,tip.x,tip.qw\n0,0,0\n", ".csv:2");
}

TEST(Replay, PlaysAKeyframedHand) {
  const MotionText file(two_tools);
  const auto device = open_device(file.device("replay", "#tip"));
  for (int i = 0; i <= 20; ++i) {
    const DeviceSample s = device->read();
    device->write({Vec3(0, 0, 5), Vec3::Zero()});
    const double t = std::min(1.0, i / 10.0);
    EXPECT_TRUE(s.connected);
    EXPECT_NEAR((s.pose.translation - Vec3(0.1 + 0.1 * t, -0.04 * t, 0)).norm(), 0, 1e-9) << i;
    const Eigen::Quaterniond q(Eigen::AngleAxisd(t * 0.5 * M_PI, Vec3::UnitZ()));
    EXPECT_NEAR(s.pose.rotation.angularDistance(q), 0, 1e-7) << i;
    if (i < 9) {
      EXPECT_NEAR((s.velocity - Vec3(10, -4, 0)).norm(), 0, 1e-6);
      EXPECT_NEAR((s.angular_velocity - Vec3(0, 0, 50 * M_PI)).norm(), 0, 1e-4);
    } else if (i > 10) {
      EXPECT_EQ(s.velocity, Vec3::Zero());
      EXPECT_NEAR(s.angular_velocity.norm(), 0, 1e-12);
    }
  }
  for (int i = 0; i < 3; ++i) {  // over: the device is gone, and says where it was last
    const DeviceSample s = device->read();
    EXPECT_FALSE(s.connected);
    EXPECT_NEAR(s.pose.translation.x(), 0.2, 1e-12);
  }
  EXPECT_EQ(open_device(file.device("replay"))->read().pose.translation.x(), 5);  // the first instrument
  const auto coarse = open_device(file.device("replay", "#tip,tick=0.005"));
  coarse->read();
  EXPECT_NEAR(coarse->read().pose.translation.x(), 0.15, 1e-9);
}

}  // namespace
}  // namespace palpate
