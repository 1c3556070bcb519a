// The virtual coupling against springs that are known and against an organ: bounds, energy, bad samples.
#include "palpate/haptics/coupling.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "loop.hpp"
#include "palpate/base/error.hpp"
#include "palpate/simulation/organs.hpp"

namespace palpate {
namespace {

constexpr double inf = std::numeric_limits<double>::infinity(),
                 nan = std::numeric_limits<double>::quiet_NaN();

// A frictionless wall below z = 0, felt at a point at the end of an arm along x (instrument's frame).
struct Wall {
  double stiffness = 1000, arm = 0;  // N/m, m
  Wrench operator()(const Pose& p) const {
    const Vec3 r = p.rotation * Vec3(arm, 0, 0);
    const Vec3 force(0, 0, std::max(0.0, -stiffness * (p.translation + r).z()));
    return {force, r.cross(force)};
  }
};

struct WallLoop {
  Wall wall;
  CouplingSettings settings;
  CouplingState state;
  DeviceSample sample;
  Wrench contact;
  explicit WallLoop(const Wall& w) : wall(w) { sample.connected = true, state.gain = 1; }
  Wrench tick(double dt = 1e-3) {
    contact = wall(couple(settings, state, sample, contact, dt));
    return hand_wrench(settings, state, contact);
  }
};

Pose at_height(double z) { return {Eigen::Quaterniond::Identity(), Vec3(0, 0, z)}; }

// Work the hand does on the device over a path of heights, J; the force is held over each tick.
template <class Tick>
double work(const Tick& tick, double from, double depth, double seconds) {
  const int n = static_cast<int>(std::lround(seconds / 1e-3));
  double sum = 0, force = 0, last = from;
  for (int i = 0; i <= n; ++i) {
    const double z = from - depth * (1 - std::abs(2.0 * i / n - 1));
    sum -= force * (z - last);
    force = tick(z), last = z;
  }
  return sum;
}

TEST(Coupling, FollowsTheHandleInTheAir) {
  WallLoop loop({0, 0});
  for (int i = 0; i < 500; ++i) {
    loop.sample.pose.translation = Vec3(0.4e-3 * i, 0.1 * std::sin(0.005 * i), 0.1);
    loop.sample.pose.rotation = Eigen::AngleAxisd(0.01 * i, Vec3(1, 2, 3).normalized());
    EXPECT_EQ(loop.tick().force, Vec3::Zero());
    EXPECT_LT((loop.state.instrument.translation - loop.sample.pose.translation).norm(), 1e-12);
    EXPECT_LT(loop.state.instrument.rotation.angularDistance(loop.sample.pose.rotation), 1e-9);
  }
}

TEST(Coupling, IsASpringAgainstAWall) {
  for (const double k : {20.0, 300.0, 5000.0}) {
    WallLoop loop({k, 0});
    loop.sample.pose = at_height(0);
    loop.tick();
    loop.sample.pose = at_height(-0.002);
    Wrench felt;
    for (int i = 0; i < 300; ++i) felt = loop.tick();
    const double both = 1 / (1 / k + 1 / loop.settings.stiffness);
    EXPECT_NEAR(felt.force.z(), 0.002 * both, 1e-9);
    EXPECT_NEAR(loop.state.translation.offset.z(), felt.force.z() / loop.settings.stiffness, 1e-12);
  }
}

// The bounds in coupling.hpp without the secant: no overshoot up to the first, settles up to the second, and
// not beyond. With the secant, ten times that.
TEST(Coupling, BoundsAreWhereTheHeaderSays) {
  const CouplingSettings s;
  const double dt = 1e-3;
  const auto swings = [&](double k, double arm, bool adapts = false) {
    WallLoop loop({k, arm});
    if (!adapts) loop.settings.stiffest = loop.settings.angular_stiffest = 1e-9;
    loop.settings.force_limit = 1e3, loop.settings.torque_limit = 1e3, loop.settings.speed_limit = 1e3;
    loop.sample.pose = at_height(-0.02);  // deep in, so that it never leaves the wall
    double least = inf, most = -inf;
    for (int i = 0; i < 3000; ++i) {
      loop.tick(dt);
      if (i >= 2000)
        least = std::min(least, loop.contact.force.z()), most = std::max(most, loop.contact.force.z());
    }
    return (most - least) / most;
  };
  const auto overshoots = [&](double k) {
    WallLoop loop({k, 0});
    loop.settings.speed_limit = 1e3, loop.settings.stiffest = 1e-9;
    loop.sample.pose = at_height(0);
    loop.tick(dt);
    loop.sample.pose = at_height(-0.001);
    double last = inf;
    bool over = false;
    for (int i = 0; i < 200; ++i) {
      const double force = loop.tick(dt).force.z();
      over = over || (i > 0 && force > last * (1 + 1e-9));
      last = force;
    }
    return over;
  };
  EXPECT_FALSE(overshoots(5000));
  EXPECT_FALSE(overshoots(0.99 * s.damping / dt));
  EXPECT_TRUE(overshoots(1.1 * s.damping / dt));
  EXPECT_LT(swings(0.98 * (s.stiffness + 2 * s.damping / dt), 0), 1e-6);
  EXPECT_GT(swings(1.02 * (s.stiffness + 2 * s.damping / dt), 0), 0.1);
  const double with_arm = 1 / (dt * (1 / s.damping + 0.1 * 0.1 / s.angular_damping));
  EXPECT_NEAR(with_arm, 5000, 1e-6);  // as promised
  EXPECT_LT(swings(1.9 * with_arm, 0.1), 1e-6);
  EXPECT_GT(swings(3 * with_arm, 0.1), 0.1);
  for (const double k : {5e3, 2.2e4, 1e5, 1e6}) EXPECT_LT(swings(k, 0, true), 1e-6) << k;
  for (const double k : {5e3, 2e4, 5e4}) EXPECT_LT(swings(k, 0.1, true), 1e-6) << k;
}

// A tick that comes late does not destabilise.
TEST(Coupling, LateTicks) {
  WallLoop loop({5000, 0});
  loop.settings.stiffest = 1e-9;  // before it has learnt
  loop.sample.pose = at_height(0);
  loop.tick();
  loop.sample.pose = at_height(-0.001);
  double last = inf;
  for (int i = 0; i < 100; ++i) {
    const double force = loop.tick(i % 3 ? 0.02 : 1e-3).force.z();
    EXPECT_LE(force, last * (1 + 1e-9));
    last = force;
  }
  EXPECT_NEAR(last, 0.001 / (1 / 5000.0 + 1 / loop.settings.stiffness), 1e-6);
}

// Slow cycles give the hand no energy: it always does work on the device. What holding the force over a tick
// generates on contacts softer than 50 N/m stays within the header's bound, and below 1e-6 J up to 10 mm/s.
TEST(Coupling, SlowCyclesAreDissipative) {
  const CouplingSettings s;
  const double dt = 1e-3, depth = 0.005;
  for (const double k : {5.0, 20.0, 60.0, 200.0, 1000.0, 5000.0})
    for (const double speed : {0.002, 0.01, 0.05}) {
      WallLoop loop({k, 0});
      loop.sample.pose = at_height(0.001);
      loop.tick();
      const double energy = work(
          [&](double z) {
            loop.sample.pose = at_height(z);
            return loop.tick().force.z();
          },
          0.001, 0.001 + depth, 2 * (0.001 + depth) / speed);
      const double a = k / (s.stiffness + k), bound = s.stiffness * s.stiffness * dt * dt / (16 * s.damping);
      const double least = k >= 100 ? 0 : speed > 0.01 ? -1.2 * bound * speed * 2 * depth : -1e-6;
      EXPECT_GT(energy, least) << k << " N/m, " << speed << " m/s";
      const double brake = a * a * (s.damping + s.stiffness * dt) * speed * 2 * depth;
      EXPECT_LT(energy, 1.05 * brake) << k << " N/m, " << speed << " m/s";
    }
}

TEST(Coupling, SlowCycleOnAnOrganIsDissipative) {
  for (const bool pillar : {false, true}) {
    ForceLoop loop(pillar ? pillar_model() : block_model(8, Sphere{0.01}));
    HeldDevice device;
    device.sample.pose = at_height(0.1 + loop.radius() + 0.001);
    for (int i = 0; i < 60; ++i) loop.tick(device);
    double most = 0;
    const double energy = work(
        [&](double z) {
          device.sample.pose.translation = Vec3(0.001, 0.002, z);
          const double force = loop.tick(device).force.z();
          most = std::max(most, force);
          EXPECT_EQ(loop.state.status & ~strain_beyond_linear, 0u);
          return force;
        },
        0.111, 0.009, 1.8);
    std::cout << (pillar ? "pillar: " : "block: ") << energy << " J into the device, " << most << " N\n";
    EXPECT_GT(energy, -1e-6);
    EXPECT_LT(energy, 0.1 * most * 0.009);
    EXPECT_GT(most, 0.3);
  }
}

TEST(Coupling, CutsAtTheLimitAndKeepsTheDirection) {
  CouplingState state;
  state.gain = 1;
  const CouplingSettings s;
  for (const double scale : {0.01, 1.0, 1e3, 1e200}) {
    const Vec3 direction = Vec3(1, -2, 2) / 3;
    const Wrench felt = hand_wrench(s, state, {scale * direction, -scale * direction});
    EXPECT_NEAR(felt.force.norm(), std::min(scale, s.force_limit), 1e-12);
    EXPECT_NEAR(felt.force.normalized().dot(direction), 1, 1e-12);
    EXPECT_NEAR(felt.torque.norm(), std::min(scale, s.torque_limit), 1e-12);
    EXPECT_NEAR(felt.torque.normalized().dot(direction), -1, 1e-12);
  }
}

// However deep the handle is, the instrument presses with no more than the limit.
TEST(Coupling, DeepHandlePressesWithTheLimit) {
  WallLoop loop({2000, 0});
  loop.sample.pose = at_height(0.01);
  for (int i = 0; i < 60; ++i) loop.tick();
  loop.sample.pose = at_height(-1);  // a jump of a metre
  double last = 0.01;
  for (int i = 0; i < 3000; ++i) {
    const Wrench felt = loop.tick();
    const double z = loop.state.instrument.translation.z();
    EXPECT_LE(std::abs(z - last), loop.settings.speed_limit * 1e-3 * (1 + 1e-9));
    EXPECT_LE(felt.force.norm(), loop.settings.force_limit * (1 + 1e-12));
    last = z;
  }
  EXPECT_NEAR(loop.contact.force.z(), loop.settings.force_limit, 0.01);
}

// A pose that is no number, of the organ say, keeps the force of the tick before; the hand does not feel it
// for ever.
TEST(Coupling, AnOldForceFades) {
  ForceLoop loop(block_model(8, Sphere{0.02}));
  HeldDevice device;
  device.sample.pose = at_height(0.115);
  for (int i = 0; i < 200; ++i) loop.tick(device);
  const double pressed = device.felt.force.z();
  EXPECT_GT(pressed, 0.1);
  const Vec3 there = loop.coupling.instrument.translation;
  loop.input.organ.translation.x() = nan;
  double last = pressed;
  for (int i = 0; i < 60; ++i) {  // the first tick does not know yet
    device.sample.pose = at_height(0.115 + 1e-3 * i);
    loop.tick(device);
    EXPECT_LE(device.felt.force.z(), last);
    EXPECT_GE(device.felt.force.z(), last - pressed / 45);
    last = device.felt.force.z();
  }
  EXPECT_EQ(last, 0);
  EXPECT_LT((loop.coupling.instrument.translation - there).norm(), 2e-3);
  loop.input.organ.translation.x() = 0;
  device.sample.pose = at_height(0.115);
  for (int i = 0; i < 200; ++i) loop.tick(device);
  EXPECT_NEAR(device.felt.force.z(), pressed, 1e-3 * pressed);
}

TEST(Coupling, BadSamplesAndTimes) {
  WallLoop loop({2000, 0});
  loop.sample.pose = at_height(-0.003);
  for (int i = 0; i < 200; ++i) loop.tick();
  const double pressed = loop.tick().force.z();
  EXPECT_GT(pressed, 1);
  const CouplingState before = loop.state;
  for (const double dt : {0.0, -1.0, nan}) {
    couple(loop.settings, loop.state, loop.sample, loop.contact, dt);
    EXPECT_EQ(loop.state.instrument.translation, before.instrument.translation);
    EXPECT_EQ(loop.state.gain, 1);
  }
  std::vector<DeviceSample> bad(7, loop.sample);
  bad[0].pose.translation.x() = nan;
  bad[1].pose.translation.z() = -inf;
  bad[2].pose.rotation.coeffs().setConstant(nan);
  bad[3].pose.rotation.coeffs().setZero();
  bad[4].pose.translation.y() = 1e300;
  bad[5].connected = false;
  bad[6].pose.rotation.coeffs() *= 1e200;
  for (const DeviceSample& sample : bad) {
    loop.state = before;
    const Wrench contact = loop.contact;
    double last = pressed;
    for (int i = 0; i < 60; ++i) {  // fades over the ramp, without a step
      const Pose pose = couple(loop.settings, loop.state, sample, contact, 1e-3);
      EXPECT_EQ(pose.translation, before.instrument.translation);
      const double force = hand_wrench(loop.settings, loop.state, contact).force.z();
      EXPECT_LE(force, last);
      EXPECT_GE(force, last - pressed / 45);
      last = force;
    }
    EXPECT_EQ(last, 0);
  }
  // It comes back with a ramp.
  loop.state = before;
  for (int i = 0; i < 60; ++i) couple(loop.settings, loop.state, bad[5], loop.contact, 1e-3);
  EXPECT_LT(loop.tick().force.z(), 0.1 * pressed);
  for (int i = 0; i < 60; ++i) loop.tick();
  EXPECT_NEAR(loop.tick().force.z(), pressed, 1e-6);
  // Contacts that are not finite, or enormous.
  for (const double f : {nan, inf, -1e308, 1e308})
    for (int i = 0; i < 10; ++i) {
      const Wrench contact{Vec3(f, 0, 1), Vec3(0, f, f)};
      const Pose pose = couple(loop.settings, loop.state, loop.sample, contact, 1e-3);
      EXPECT_TRUE(pose.translation.allFinite() && pose.rotation.coeffs().allFinite());
      EXPECT_LT(pose.translation.norm(), 1);
      EXPECT_NEAR(pose.rotation.norm(), 1, 1e-12);
      const Wrench felt = hand_wrench(loop.settings, loop.state, contact);
      EXPECT_TRUE(felt.force.allFinite() && felt.torque.allFinite());
      EXPECT_LE(felt.force.norm(), loop.settings.force_limit * (1 + 1e-12));
    }
}

// The first sample places the instrument; the force begins at nothing.
TEST(Coupling, BeginsWithoutAKick) {
  WallLoop loop({2000, 0});
  loop.state.gain = 0, loop.sample.connected = false;
  for (int i = 0; i < 10; ++i) EXPECT_EQ(loop.tick().force, Vec3::Zero());
  loop.sample.connected = true;
  loop.sample.pose = at_height(-0.5);
  double last = 0;
  for (int i = 0; i < 60; ++i) {
    const double force = loop.tick().force.z();
    EXPECT_LE(force - last, loop.settings.force_limit * 1e-3 / loop.settings.ramp * (1 + 1e-9));
    last = force;
  }
}

// Until a device is heard of the instrument waits where the caller put it.
TEST(Coupling, WaitsWhereItIsPut) {
  CouplingState state;
  state.instrument = {Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Vec3::UnitX())), Vec3(0.1, 0.2, 0.3)};
  const Pose put = state.instrument;
  DeviceSample sample;  // of no device
  for (int k = 0; k < 3; ++k) {
    const Pose pose = couple({}, state, sample, {}, 1e-3);
    EXPECT_EQ(pose.translation, put.translation);
    EXPECT_EQ(pose.rotation.coeffs(), put.rotation.coeffs());
    EXPECT_EQ(hand_wrench({}, state, {Vec3(1, 2, 3), Vec3::Zero()}).force, Vec3::Zero());
  }
  sample.connected = true, sample.pose = at_height(0.4);
  EXPECT_EQ(couple({}, state, sample, {}, 1e-3).translation, Vec3(0, 0, 0.4));
}

// Clear of every organ, however these and the instrument lie.
TEST(Coupling, AnInstrumentWithoutAMotionIsClearOfTheOrgans) {
  for (const Shape& shape : {Shape{Sphere{0.03}}, Shape{Cuboid{Vec3(0.1, 0.2, 0.3)}}, Shape{HalfSpace{}},
                             Shape{Capsule{1e-3, 0.2}}}) {
    std::vector<Model> models;
    models.push_back(block_model(3, shape)), models.push_back(block_model(2, shape));
    std::vector<Input> inputs = make_inputs(models);
    inputs[1].organ = {Eigen::Quaterniond(Eigen::AngleAxisd(2, Vec3(1, 1, 0).normalized())),
                       Vec3(0.1, 0.3, -0.4)};
    std::vector<State> states = make_states(models);
    place(inputs, 0, clear_of(models, inputs, 0));
    for (std::size_t i = 0; i < models.size(); ++i) {
      step(models[i], states[i], inputs[i]);
      EXPECT_EQ(states[i].status, 0u);
      EXPECT_TRUE(states[i].contacts.empty());
      for (const Vec3& v : models[i].organ.surface.vertices)
        EXPECT_GT(distance(shape, inputs[i].instruments[0].inverse() * (inputs[i].organ * v)), 0.1);
    }
  }
}

TEST(Coupling, ChecksItsSettings) {
  EXPECT_NO_THROW(check({}));
  for (double CouplingSettings::*member :
       {&CouplingSettings::stiffness, &CouplingSettings::stiffest, &CouplingSettings::angular_stiffest,
        &CouplingSettings::damping, &CouplingSettings::force_limit, &CouplingSettings::angular_stiffness,
        &CouplingSettings::angular_damping, &CouplingSettings::torque_limit, &CouplingSettings::speed_limit,
        &CouplingSettings::angular_speed_limit, &CouplingSettings::ramp, &CouplingSettings::tick})
    for (const double value : {0.0, -1.0, nan, inf}) {
      CouplingSettings s;
      s.*member = value;
      EXPECT_THROW(check(s), Error);
    }
}

}  // namespace
}  // namespace palpate
