#include "palpate/simulation/scene.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "fixtures.hpp"
#include "palpate/base/error.hpp"
#include "palpate/io/tet_file.hpp"
#include "palpate/simulation/record.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

class SceneFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("palpate_scene_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
    write_organ(folder_ / "block.h5", block_organ(4), "test");
    put("motion.csv", "time,ball.x,ball.y,ball.z\n0,0,0,140\n# a comment\n\n0.1,0,0,120\n0.2,10,0,140\n");
  }
  void TearDown() override { fs::remove_all(folder_); }
  void put(const std::string& name, const std::string& text) { std::ofstream(folder_ / name) << text; }
  Scene read(const std::string& text) {
    put("scene.toml", text);
    return read_scene(folder_ / "scene.toml", 1);
  }
  std::string error(const std::string& text) {
    try {
      read(text);
    } catch (const Error& e) {
      return std::to_string(static_cast<int>(e.kind())) + " " + e.what();
    }
    return "none";
  }
  fs::path folder_;
};

const std::string good =
    "[organ]\nmodel = \"block.h5\"\n[[instrument]]\nname = \"ball\"\nsphere = \"30 mm\"\n"
    "[motion]\nfile = \"motion.csv\"\nunit = \"mm\"\ndt = \"1 ms\"\n[settings]\nmode = \"unilateral\"\n";

TEST_F(SceneFile, RunsFromFileToFolder) {
  const Scene scene = read(good);
  EXPECT_EQ(scene.steps, 201u);
  EXPECT_EQ(scene.dt, 0.001);
  EXPECT_EQ(std::get<Sphere>(scene.models[0].instruments[0].shape).radius, 0.03);
  State state = make_state(scene.models[0]);
  Recorder recorder(folder_ / "out", scene.models[0], 100);
  for (std::size_t k = 0; k < scene.steps; ++k) {
    const Input input = input_at(scene.motion, 0.001 * static_cast<double>(k));
    step(scene.models[0], state, input);
    recorder.add(k, state);
  }
  const RunSummary summary = recorder.finish();
  EXPECT_EQ(summary.steps, 201u);
  EXPECT_EQ(summary.not_converged, 0u);
  EXPECT_NEAR(summary.deepest_before, 0.01, 1e-9);
  EXPECT_NEAR(summary.peak_time, 0.1, 1e-9);
  EXPECT_GT(summary.peak_direction.z(), 0.95);  // the block's tetrahedra are not symmetric
  for (const char* name :
       {"frames.pvd", "forces.csv", "summary.json", "frames/frame000000.vtu", "frames/frame000200.vtu"})
    EXPECT_TRUE(fs::exists(folder_ / "out" / name)) << name;
  std::ifstream forces(folder_ / "out" / "forces.csv");
  std::size_t lines = 0;
  for (std::string line; std::getline(forces, line);) ++lines;
  EXPECT_EQ(lines, 202u);
}

TEST_F(SceneFile, MotionIsInterpolatedAndHeldAtItsEnds) {
  const MotionFile motion = read_motion(folder_ / "motion.csv", {"ball"}, 1e-3);
  EXPECT_LT((input_at(motion, -1).instruments[0].translation - Vec3(0, 0, 0.14)).norm(), 1e-15);
  EXPECT_LT((input_at(motion, 0.05).instruments[0].translation - Vec3(0, 0, 0.13)).norm(), 1e-15);
  EXPECT_LT((input_at(motion, 0.15).instruments[0].translation - Vec3(0.005, 0, 0.13)).norm(), 1e-15);
  EXPECT_LT((input_at(motion, 9).instruments[0].translation - Vec3(0.01, 0, 0.14)).norm(), 1e-15);
  MotionFile turned = motion;
  turned.motion.poses[1][0].rotation = Eigen::AngleAxisd(0.8, Vec3::UnitY());
  turned.organs[2][0].translation.x() = 7;
  write_motion(folder_ / "again.csv", turned, {"ball"});
  const MotionFile again = read_motion(folder_ / "again.csv", {"ball"});
  ASSERT_EQ(again.motion.times, turned.motion.times);
  EXPECT_LT((again.motion.poses[1][0].rotation.coeffs() - turned.motion.poses[1][0].rotation.coeffs()).norm(),
            1e-15);
  EXPECT_EQ(again.organs[2][0].translation.x(), 7);
  EXPECT_NEAR(Eigen::AngleAxisd(input_at(again, 0.05).instruments[0].rotation).angle(), 0.4, 1e-12);
}

const std::string two =
    "[[organ]]\nname = \"low\"\nmodel = \"block.h5\"\n[[organ]]\nname = \"high\"\ntets = \"block.msh\"\n"
    "order = 1\nmaterials.tissue = { young = \"20 kPa\", poisson = 0.45 }\nanchors = [\"half-space 0 0 0 0 0 "
    "1\"]\n[[instrument]]\nname = \"ball\"\nsphere = \"30 mm\"\n[motion]\nfile = \"motion.csv\"\n";

TEST_F(SceneFile, SeveralOrgansHaveNamesAndMaterialsOfTheirOwn) {
  write_tets(folder_ / "block.msh", make_block({Vec3(-0.05, -0.05, 0), Vec3(0.05, 0.05, 0.1)}, {4, 4, 4}));
  put("motion.csv",
      "time,ball.z,high.z,high.qw,high.qx\n0,0.135,0.27,0,1\n0.1,0.125,0.247,0,1\n");  // head down
  const Scene scene = read(two);
  ASSERT_EQ(scene.models.size(), 2u);
  EXPECT_EQ(scene.organs, (std::vector<std::string>{"low", "high"}));
  EXPECT_EQ(scene.models[1].organ.materials[0].young, 20e3);
  EXPECT_EQ(scene.models[0].organ.materials[0].young, 10e3);
  std::vector<State> states = make_states(scene.models);
  std::vector<Input> inputs = make_inputs(scene.models);
  Recorder recorder(folder_ / "out", scene.models, scene.organs, 50);
  for (std::size_t k = 0; k < scene.steps; ++k) {
    set_inputs(scene.motion, 0.001 * static_cast<double>(k), inputs);
    step(scene.models, states, inputs);
    recorder.add(k, states);
  }
  EXPECT_EQ(inputs[0].organ.translation, Vec3::Zero());
  EXPECT_NEAR(inputs[1].organ.translation.z(), 0.247, 1e-15);
  EXPECT_EQ(inputs[0].instruments[0].translation, inputs[1].instruments[0].translation);
  const RunSummary summary = recorder.finish();
  ASSERT_EQ(summary.organs.size(), 2u);
  EXPECT_EQ(summary.organs[1].first, "high");
  EXPECT_GT(summary.organs[0].second.peak_direction.z(), 0.9);
  EXPECT_LT(summary.organs[1].second.peak_direction.z(), -0.9);
  EXPECT_EQ(summary.surface_nodes,
            summary.organs[0].second.surface_nodes + summary.organs[1].second.surface_nodes);
  // Both press: what the ball feels is the difference.
  EXPECT_LT(summary.peak_force, summary.organs[1].second.peak_force);
  for (const char* part : {"\"organs\"", "\"name\": \"high\""})
    EXPECT_NE(summary_json(summary).find(part), std::string::npos);
  std::ifstream forces(folder_ / "out" / "forces.csv");
  std::string header, line;
  std::getline(forces, header), std::getline(forces, line);
  EXPECT_NE(
      header.find(",ball.fz_N,ball.tx_Nm,ball.ty_Nm,ball.tz_Nm,ball.grasped,low.contacts,low.ball.fx_N"),
      std::string::npos);
  EXPECT_EQ(std::count(header.begin(), header.end(), ','), std::count(line.begin(), line.end(), ','));
}

TEST_F(SceneFile, MistakesWithSeveralOrgans) {
  write_tets(folder_ / "block.msh", make_block({Vec3(-0.05, -0.05, 0), Vec3(0.05, 0.05, 0.1)}, {4, 4, 4}));
  const auto replaced = [](const std::string& from, const std::string& to) {
    std::string text = two;
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  EXPECT_EQ(error(two), "none");
  for (const auto& [text, expected] : std::vector<std::pair<std::string, std::string>>{
           {replaced("high", "low"), "scene.toml:5: organ.name: 'low' is taken"},
           {replaced("\"ball\"", "\"low\""), "instrument.name: 'low' is taken"},
           {two + "[settings]\nmode = \"gaussian\"\n", "one [organ]"},
           {replaced("order = 1", "ordre = 1"), "unknown"},
           {"organ = []\n" + two.substr(two.find("[[instrument]]")), "organ: this list is empty"},
           {"organ = [1]\n" + two.substr(two.find("[[instrument]]")), "must hold tables"}}) {
    const std::string message = error(text);
    EXPECT_NE(message.find(expected), std::string::npos) << "wanted '" << expected << "' in: " << message;
  }
  put("motion.csv", "time,ball.z,organ.z\n0,1,1\n");
  EXPECT_NE(
      error(two).find("column 'organ.z' is unknown; use time and NAME.x .y .z .qw .qx .qy .qz with NAME "
                      "one of ball, low, high"),
      std::string::npos)
      << error(two);
}

TEST_F(SceneFile, EveryMistakeIsOneClearLine) {
  const auto replaced = [](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  EXPECT_EQ(error(good), "none");
  const std::vector<std::pair<std::string, std::string>> cases{
      {"", "motion"},
      {"not toml at all [", "scene.toml:1"},
      {replaced("sphere", "spere"), "say surface, lattice, sphere"},
      {replaced("30 mm", "30 parsec"), "scene.toml:5: instrument.sphere"},
      {replaced("30 mm", "-30 mm"), "above zero"},
      {replaced("30 mm", "300000 mm"), "check unit and scale"},
      {replaced("sphere = \"30 mm\"", "capsule = [\"5 mm\", \"-2 mm\"]"), "above zero"},
      {replaced("sphere = \"30 mm\"", "capsule = [0, \"5 mm\"]"), "above zero"},
      {replaced("sphere = \"30 mm\"", "cuboid = [0.01, -0.01, 0.01]"), "above zero"},
      {replaced("block.h5", "nothing.h5"), "nothing.h5"},
      {replaced("block.h5", "motion.csv"), "motion.csv"},
      {replaced("unilateral", "bilateral"), "prescribed"},
      {replaced("1 ms", "0 ms"), "above zero"},
      {replaced("unit = \"mm\"", "unit = \"furlong\""), "furlong"},
      {replaced("name = \"ball\"", "name = \"organ\""), "taken"},
      {replaced("[settings]", "[settings]\ncolour = 3"), "unknown"},
      {replaced("model = \"block.h5\"", "surface = \"motion.csv\""), "motion.csv"},
  };
  for (const auto& [text, expected] : cases) {
    const std::string message = error(text);
    EXPECT_NE(message.find(expected), std::string::npos) << "wanted '" << expected << "' in: " << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
  for (const auto& [csv, expected] : std::vector<std::pair<std::string, std::string>>{
           {"", "no poses"},
           {"time,ball.x\n", "no poses"},
           {"x,y\n0,0\n", "unknown"},
           {"ball.x\n0\n", "no column 'time'"},
           {"time,ball.x\n0,1\n0,2\n", "motion.csv:3"},
           {"time,ball.x\n0,abc\n", "abc"},
           {"time,ball.x\n0,nan\n", "nan"},
           {"time,ball.x\n0\n", "1 values"},
           {"time,ball.qw,ball.qx,ball.qy,ball.qz\n0,0,0,0,0\n", "quaternion"}}) {
    put("motion.csv", csv);
    const std::string message = error(good);
    EXPECT_NE(message.find(expected), std::string::npos) << "wanted '" << expected << "' in: " << message;
  }
}

// A cone of 20 mm, its tip to -z: thick by its box, and its tip is lost between nodes unless that is said.
TEST(Advice, IsOfTipsThatNodesMiss) {
  TriangleMesh cone;
  cone.vertices = {Vec3(0, 0, -0.03), Vec3(0, 0, 0)};
  for (Index k = 0; k < 24; ++k) {
    const double angle = 2 * M_PI * k / 24;
    cone.vertices.push_back(Vec3(0.01 * std::cos(angle), 0.01 * std::sin(angle), 0));
    const Index next = 2 + (k + 1) % 24;
    cone.triangles.push_back({0, next, 2 + k}), cone.triangles.push_back({1, 2 + k, next});
  }
  ASSERT_GT(volume(cone), 0);
  const Shape ball = Sphere{0.01}, box = Cuboid{Vec3(0.01, 0.01, 0.01)}, needle = Capsule{1e-3, 0.02},
              lattice = lattice_of(cone, 0.5e-3);
  Scene scene;
  scene.models.push_back(block_model(20, ball));  // 5 mm between nodes
  Model& model = scene.models[0];
  model.instruments = {{"ball", ball, surface_of_primitive(ball)},
                       {"box", box, surface_of_primitive(box)},
                       {"needle", needle, surface_of_primitive(needle)},
                       {"cone", lattice, cone},
                       {"known", lattice, cone, 1e-3}};
  const std::vector<std::string> texts = advice(scene);
  ASSERT_EQ(texts.size(), 1u);
  EXPECT_NE(texts[0].find("'cone'"), std::string::npos) << texts[0];
  EXPECT_NE(texts[0].find("tip = "), std::string::npos) << texts[0];
  const double thin = thinnest_part(model.instruments[3], 0.01);
  EXPECT_GT(thin, 0.5e-3);
  EXPECT_LT(thin, 2.5e-3);  // a tenth from its tip it is 2 mm wide
  EXPECT_EQ(thinnest_part(model.instruments[0], 0.01), 0.01);
  const Shape sheet = Cuboid{Vec3(0.01, 0.01, 0.025e-3)};
  EXPECT_NEAR(thinnest_part({"sheet", sheet, surface_of_primitive(sheet)}, 0.01), 0.05e-3, 1e-6);

  // What it is about: in the middle of a triangle, 0.8 mm deep.
  double felt[2];
  for (const double tip : {0.0, 1e-3}) {
    model.instruments = {{"cone", lattice, cone, tip}};
    State state = make_state(model);
    step(model, state, at(Vec3(1.7e-3, 1.2e-3, 0.1 + 0.03 - 0.8e-3)));
    felt[tip > 0] = state.wrenches[0].force.z();
  }
  EXPECT_EQ(felt[0], 0);
  EXPECT_GT(felt[1], 0);
}

}  // namespace
}  // namespace palpate
