// The simulated hand alone, and pressing on stone for a minute.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include "loop.hpp"
#include "motion_file.hpp"
#include "palpate/pad/pad.hpp"
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

// A kidney of soft tissue with a stone in it, its back anchored, and a ball.
Model kidney_model() {
  TetMesh mesh = pad_delaunay(make_kidney(600), {{"stone", make_stone(150)}}).mesh;
  std::vector<Material> materials;
  for (const std::string& region : mesh.region_names)
    materials.push_back(region == "stone" ? Material{1e9, 0.3, 2000} : Material{10e3, 0.45, 1000});
  Model model;
  model.organ = bake(std::move(mesh), std::move(materials), {AnchorHalfSpace{{0, 0, -0.016}, {0, 0, 1}}}, 0,
                     {}, nullptr, {.order = 2, .pinch = false});
  model.instruments.push_back({"tool", Sphere{0.01}, {}});
  return model;
}

// A minute on a kidney, where a force along the surface's normal moves it least, which is beside the anchor,
// and where it does most.
TEST(Loopback, PressesOnAKidneyWithoutOscillation) {
  const Model model = kidney_model();
  const Organ& organ = model.organ;
  std::vector<Vec3> normals(organ.surface_size(), Vec3::Zero());
  for (const Triangle& t : organ.surface.triangles)
    for (const Index i : t) normals[static_cast<std::size_t>(i)] += area_vector(organ.surface, t);
  std::vector<std::pair<double, Index>> places;  // m/N
  for (const Index node : organ.node_of_row) {
    const Index row = organ.row_of[static_cast<std::size_t>(node)];
    std::array<float, 9> c;
    organ.compliance.block({&row, 1}, {&row, 1}, c, 3);
    const Vec3 n = normals[static_cast<std::size_t>(node)].normalized();
    places.push_back({n.dot(Eigen::Map<const Eigen::Matrix3f>(c.data()).cast<double>() * n), node});
  }
  std::sort(places.begin(), places.end());
  for (const auto& [softness, node] : {places.front(), places.back()}) {
    const Vec3 p = organ.contact_points[static_cast<std::size_t>(node)],
               out = normals[static_cast<std::size_t>(node)].normalized();
    std::string way = "time,hand.x,hand.y,hand.z\n";
    for (const auto& [time, height] : {std::pair{0.0, 0.015}, {0.2, 0.015}, {1.0, 0.002}, {60.0, 0.002}}) {
      const Vec3 at = p + height * out;
      way += fmt::format("{},{},{},{}\n", time, at.x(), at.y(), at.z());
    }
    const MotionText file(way);
    const auto device =
        open_device(file.device("loopback", ",mass=0.05,stiffness=1000,damping=0.5,friction=0.1"));
    ForceLoop loop(model);
    loop.coupling.instrument.translation = p + 0.03 * out;
    Swing force, height;
    for (int i = 0; i < 60000; ++i) {
      const double felt = loop.tick(*device).force.norm();
      if (i > 5000) force.add(felt), height.add(loop.sample.pose.translation.dot(out));
      ASSERT_EQ(loop.state.status & (bad_input | too_many_contacts), 0u);
    }
    std::cout << 1 / softness << " N/m at a node, " << force.most << " N; swings by " << force.size()
              << " N, " << height.size() << " m\n";
    EXPECT_GT(force.least, 0.1);
    EXPECT_LT(force.size(), 1e-4);
    EXPECT_LT(height.size(), 1e-6);
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
