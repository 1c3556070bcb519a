// Scenes through the program: those of the project, and real organs where the data are there.
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "run.hpp"
#include "unit/io/io_test.hpp"

namespace palpate {
namespace {

using nlohmann::json;

struct Simulate : ::testing::Test {
  TempFolder folder;
  json operator()(const std::string& scene, const std::string& options = "") const {
    const Ran run = run_palpate("simulate '" + scene + "' --json --no-pictures --every 0 -o '" +
                                (folder / "run").string() + "' " + options);
    EXPECT_EQ(run.exit_code, 0) << run.output;
    return json::parse(run.output, nullptr, false);
  }
  json project(const std::string& name) const {
    return (*this)(PALPATE_SOURCE_DIR "/scenes/" + name + ".toml");
  }
};

TEST_F(Simulate, ABallOnTheKidney) {
  const json r = project("ball");
  EXPECT_EQ(r["steps"], 1101);
  // 7.7 mm, and the centroids of hats of 5 mm are 0.14 mm under the surface.
  EXPECT_NEAR(r["deepest_before_m"].get<double>(), 0.00756, 1e-4);
  EXPECT_LT(r["deepest_after_m"].get<double>(), 1.5e-7);  // 1e-6 of the kidney's 143 mm
  EXPECT_GT(r["peak_force_direction"][2].get<double>(), 0.95);
  EXPECT_LE(r["not_converged"].get<int>(), 5);
  EXPECT_GT(r["peak_force_N"].get<double>(), 0.5);
}

TEST_F(Simulate, PrescribedTouchesWithoutPenetration) {
  const json r = project("prescribed");
  EXPECT_LT(r["deepest_after_m"].get<double>(), 1.5e-7);
  EXPECT_GT(r["contacts_max"].get<int>(), 8);
}

TEST_F(Simulate, GaussianForceIsTheGivenOne) {
  const json r = project("gaussian");
  EXPECT_NEAR(r["peak_force_N"].get<double>(), 1, 1e-6);
  EXPECT_EQ(r["deepest_before_m"], 0);
}

TEST_F(Simulate, AGripPulls) {
  const json r = project("grip");
  EXPECT_GT(r["grasped_max"].get<int>(), 10);
  EXPECT_LT(r["peak_force_direction"][2].get<double>(), -0.95);  // on the ball, down
  EXPECT_NEAR(r["peak_force_N"].get<double>(), 1.18, 0.02);
  EXPECT_GE(r["peak_force_time_s"].get<double>(), 0.8);
  EXPECT_EQ(r["not_converged"], 0);
  EXPECT_GT(r["strain_beyond_linear"].get<int>(), 100);
}

TEST_F(Simulate, ImprintStaysAndCostsNoForce) {
  const json r = project("imprint");
  EXPECT_EQ(r["peak_force_N"], 0);
  EXPECT_GT(r["contacts_max"].get<int>(), 5);
}

struct RealOrgans : Simulate {
  std::string data;
  void SetUp() override {
    const char* given = std::getenv("PALPATE_DATA");
    data = given ? given : PALPATE_SOURCE_DIR "/../shared/data";
    if (!std::filesystem::exists(data)) GTEST_SKIP() << data << " is not there; set PALPATE_DATA";
  }
  // Approach, press, slide, leave: each pose a line of the motion.
  json press(const std::string& organ, const std::string& instrument, const std::string& motion) const {
    folder.write("m.csv", "time,tool.qw,tool.qx,tool.qy,tool.qz,tool.x,tool.y,tool.z\n" + motion);
    folder.write("s.toml", "[organ]\n" + organ + "\n[[instrument]]\nname = 'tool'\n" + instrument +
                               "\n[motion]\nfile = 'm.csv'\n");
    return (*this)((folder / "s.toml").string());
  }
};

// Runs through itself at six places; its size is not stated: inches make it a liver. The bishop head first.
TEST_F(RealOrgans, LiverAndBishop) {
  const std::string down = ",0.70710678,-0.70710678,0,0,";
  const json r = press("surface = '" + data +
                           "/organs/liver-smooth.obj'\nunit = 'in'\nmethod = 'delaunay'\nrepair = "
                           "true\nanchors = ['half-space 0 0 "
                           "0.4 0 0 1']\nmaterials.tissue = { young = '5 kPa', poisson = 0.45 }",
                       "surface = '" + data + "/inventor/bishop.iv'\nsubdivisions = 40",
                       "0" + down + "-0.0626,0.0399,0.1616\n0.6" + down + "-0.0626,0.0399,0.1476\n1" + down +
                           "-0.0526,0.0399,0.1476\n1.2" + down + "-0.0526,0.0399,0.1616\n");
  EXPECT_EQ(r["surface_nodes"], 2194);
  EXPECT_GT(r["deepest_before_m"].get<double>(), 0.004);
  EXPECT_LT(r["deepest_after_m"].get<double>(), 5e-6);  // of the ticks that do not converge
  EXPECT_LE(r["not_converged"].get<int>(), 6);
  EXPECT_GT(r["peak_force_N"].get<double>(), 0.05);
  EXPECT_LT(r["peak_force_N"].get<double>(), 1);
}

TEST_F(RealOrgans, VentricleOfGivenTetrahedraAndABall) {
  const std::string q = ",1,0,0,0,";
  std::vector<json> runs;
  for (const std::string& file :
       std::vector<std::string>{"VH_F_left_ventricle.msh", "VH_F_left_ventricle_v41_bin.msh"})
    runs.push_back(press("tets = '" + data + "/derived/" + file +
                             "'\nunit = 'mm'\nanchors = ['half-space 50 0 0 1 0 0']\n"
                             "materials.tissue = { young = '30 kPa', poisson = 0.45 }",
                         "sphere = '15 mm'",
                         "0" + q + "0.1266,0.4247,-0.049\n0.5" + q + "0.1146,0.4247,-0.049\n0.8" + q +
                             "0.1146,0.4277,-0.056\n1" + q + "0.1266,0.4277,-0.056\n"));
  EXPECT_EQ(runs[0]["surface_nodes"], 4913);
  EXPECT_NEAR(runs[0]["deepest_before_m"].get<double>(), 0.00795, 2e-5);  // 8 mm of the nodes themselves
  EXPECT_LT(runs[0]["deepest_after_m"].get<double>(), 1.5e-7);
  EXPECT_EQ(runs[0]["not_converged"], 0);
  EXPECT_GT(runs[0]["peak_force_direction"][0].get<double>(), 0.98);
  EXPECT_NEAR(runs[0]["peak_force_N"].get<double>(), 1.86, 0.02);  // 2.08 with linear tetrahedra, which lock
  // The same mesh in another format.
  EXPECT_NEAR(runs[1]["peak_force_N"].get<double>() / runs[0]["peak_force_N"].get<double>(), 1, 1e-3);
}

}  // namespace
}  // namespace palpate
