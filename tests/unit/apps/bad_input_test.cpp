// Every kind of bad input through the program: one line that says what is wrong, an exit code, nothing
// half-written.
#include <gtest/gtest.h>

#include <algorithm>

#include "palpate/base/error.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/io/surface_file.hpp"
#include "run.hpp"
#include "unit/io/io_test.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

struct BadInput : ::testing::Test {
  TempFolder folder;
  std::string at(const std::string& name) const { return "'" + (folder / name).string() + "'"; }

  // Fails with this code and one line holding `word`; no file is left that was not there before.
  void expect_refused(const std::string& arguments, ErrorKind kind, const std::string& word,
                      const std::string& shell = "") const {
    SCOPED_TRACE(arguments);
    const auto files = [&] {
      std::vector<fs::path> list;
      for (const auto& entry : fs::recursive_directory_iterator(folder / ""))
        if (entry.is_regular_file()) list.push_back(entry.path());
      std::sort(list.begin(), list.end());
      return list;
    };
    const std::vector<fs::path> before = files();
    const Ran run = run_palpate(arguments, shell);
    EXPECT_EQ(run.exit_code, static_cast<int>(kind)) << run.output;
    const std::size_t line = run.output.find("palpate: ");
    ASSERT_NE(line, std::string::npos) << run.output;
    EXPECT_EQ(run.output.find('\n', line), run.output.size() - 1) << run.output;
    EXPECT_NE(run.output.find(word, line), std::string::npos) << run.output;
    EXPECT_EQ(files(), before);
  }
  void SetUp() override {
    write_surface(folder / "ball.stl", make_star_shaped(Vec3::Zero(), 6, [](const Vec3&) { return 0.03; }));
  }
  void pad_ball() const {
    ASSERT_EQ(run_palpate("pad " + at("ball.stl") + " -o " + at("ball.vtu")).exit_code, 0);
  }
};

const std::string anchor = " --anchor 'half-space 0 0 -0.01 0 0 1' ";
const std::string material = " --material 1e4,0.4 ";

TEST_F(BadInput, FilesThatAreNone) {
  folder.write("empty.obj", "");
  folder.write("words.stl", "what is this");
  folder.write("picture.iv", "\x89PNG\r\n\x1a\n and so on");
  folder.write("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  const std::vector<std::string> commands{"info ", "lattice -o " + at("o.h5") + " ",
                                          "pad -o " + at("o.vtu") + " "};
  for (const std::string& command : commands) {
    expect_refused(command + at("none.obj"), ErrorKind::file, "none.obj");
    expect_refused(command + "'" + (folder / "").string() + "'", ErrorKind::file, "is ");
    expect_refused(command + at("empty.obj"), ErrorKind::format, "empty");
    expect_refused(command + at("words.stl"), ErrorKind::format, "words.stl");
    expect_refused(command + at("picture.iv"), ErrorKind::format, "picture.iv");
    expect_refused(command + at("nan.obj"), ErrorKind::format, "line 2");
  }
}

TEST_F(BadInput, Truncated) {
  pad_ball();
  ASSERT_EQ(run_palpate("precompute " + at("ball.vtu") + anchor + material + "-o " + at("ball.h5")).exit_code,
            0);
  ASSERT_EQ(run_palpate("lattice -n 8 " + at("ball.stl") + " -o " + at("l.h5")).exit_code, 0);
  for (const std::string name : {"ball.stl", "ball.vtu", "ball.h5", "l.h5"}) {
    const fs::path half = folder / ("half_" + name);
    fs::copy_file(folder / name, half);
    fs::resize_file(half, fs::file_size(half) / 2);
    expect_refused("info " + at("half_" + name), ErrorKind::format, "half_" + name);
  }
  folder.write("m.csv", "time,instrument1.x\n0,1\n1,0\n");
  folder.write(
      "scene.toml",
      "[organ]\nmodel = 'half_ball.h5'\n[[instrument]]\nsphere = '1 cm'\n[motion]\nfile = 'm.csv'\n");
  expect_refused("simulate " + at("scene.toml") + " -o " + at("run"), ErrorKind::format, "half_ball.h5");
}

TEST_F(BadInput, SurfacesUnfitForPadding) {
  TriangleMesh open = make_kidney(200);
  open.triangles.pop_back();
  write_surface(folder / "open.stl", open);
  expect_refused("pad " + at("open.stl") + " -o " + at("o.vtu"), ErrorKind::geometry, "3 edges");
  expect_refused("pad --spacing 1e-8 " + at("ball.stl") + " -o " + at("o.vtu"), ErrorKind::resource,
                 "spacing");
  expect_refused("pad --region x=" + at("none.stl") + " " + at("ball.stl") + " -o " + at("o.vtu"),
                 ErrorKind::file, "none.stl");
}

TEST_F(BadInput, NoAnchorAndNoMaterial) {
  pad_ball();
  const std::string precompute = "precompute " + at("ball.vtu") + " -o " + at("o.h5") + " ";
  expect_refused(precompute + anchor, ErrorKind::usage, "no material");
  expect_refused(precompute + material, ErrorKind::physics, "0 of its nodes are held");
  expect_refused(precompute + material + "--anchor 'nodes 1,2'", ErrorKind::physics,
                 "2 of its nodes are held");
  expect_refused(precompute + material + "--anchor 'half-space 0 0 9 0 0 1'", ErrorKind::physics,
                 "nothing can move");
  expect_refused(precompute + material + "--anchor 'cone 1 2'", ErrorKind::usage, "no kind of anchor");
  for (const std::string nu : {"0.5", "0.7", "-1", "nan"})
    expect_refused(precompute + anchor + "--material 1e4," + nu, ErrorKind::physics, "Poisson's ratio");
  for (const std::string e : {"0", "-5", "nan", "inf"})
    expect_refused(precompute + anchor + "--material " + e + ",0.4", ErrorKind::physics, "Young's modulus");
  expect_refused(precompute + anchor + "--material bone=1e4,0.4", ErrorKind::usage, "bone");
  expect_refused(precompute + anchor + "--material cheese", ErrorKind::usage, "liver");
  expect_refused(precompute + material + "--bedding 'half-space 0 0 0 0 0 1'", ErrorKind::usage, "N/m3");
  expect_refused(precompute + material + "--bedding '1e5 half-space 0 0 9 0 0 -1'", ErrorKind::physics,
                 "no triangle");
  const Ran bedded =
      run_palpate(precompute + "--material liver --order 1 --bedding '1e5 half-space 0 0 0 0 0 1'");
  EXPECT_EQ(bedded.exit_code, 0) << bedded.output;  // springs are enough
}

TEST_F(BadInput, InvertedTetrahedraAreNumbered) {
  folder.write(
      "a.mesh",
      "MeshVersionFormatted 2\nDimension 3\nVertices\n5\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 1 1 0\n"
      "Tetrahedra\n2\n1 2 3 4 1\n3 2 4 5 1\nEnd\n");
  expect_refused("precompute " + at("a.mesh") + " -o " + at("o.h5") + anchor + material, ErrorKind::geometry,
                 "1 tetrahedra are inverted (from 0: 1)");
  EXPECT_NE(run_palpate("info " + at("a.mesh")).output.find("tetrahedra 1 (from 0)"), std::string::npos);
}

TEST_F(BadInput, AbsurdSizes) {
  pad_ball();
  ASSERT_EQ(run_palpate("precompute " + at("ball.vtu") + anchor + material + "-o " + at("ball.h5")).exit_code,
            0);
  expect_refused("lattice -n 1000000 " + at("ball.stl") + " -o " + at("o.h5"), ErrorKind::resource, "memory");
  folder.write("m.csv", "time,tool.z\n0,1\n1,0\n");
  const std::string scene =
      "[organ]\nmodel = 'ball.h5'\n[motion]\nfile = 'm.csv'\n[[instrument]]\nname = 'tool'\nsurface = "
      "'ball.stl'\nscale = ";
  for (const std::string scale : {"1e6", "1e-6"}) {
    folder.write("scene.toml", scene + scale + "\n");
    expect_refused("simulate " + at("scene.toml") + " -o " + at("run"), ErrorKind::format, "'tool' measures");
  }
}

// A disk that takes 8 kB.
TEST_F(BadInput, FullDisk) {
  pad_ball();
  const std::string full = "trap '' XFSZ; ulimit -f 16;";
  expect_refused("pad " + at("ball.stl") + " -o " + at("o.vtu"), ErrorKind::file, "o.vtu", full);
  expect_refused("lattice -n 20 " + at("ball.stl") + " -o " + at("o.h5"), ErrorKind::file, "o.h5", full);
  expect_refused("lattice -n 20 " + at("ball.stl") + " -o " + at("o.txt"), ErrorKind::file, "o.txt", full);
  expect_refused("precompute " + at("ball.vtu") + anchor + material + "-o " + at("o.h5"), ErrorKind::file,
                 "o.h5", full);
  expect_refused("convert " + at("ball.vtu") + " " + at("o.msh"), ErrorKind::file, "o.msh", full);
}

TEST_F(BadInput, CommandLines) {
  expect_refused("", ErrorKind::usage, "subcommand is required");
  expect_refused("frobnicate", ErrorKind::usage, "'frobnicate' is no command");
  expect_refused("info", ErrorKind::usage, "input");
  expect_refused("lattice " + at("ball.stl") + " -o x.h5 --sign maybe", ErrorKind::usage, "maybe");
  expect_refused("lattice " + at("ball.stl") + " -o x.h5 --unit parsec", ErrorKind::usage, "parsec");
  expect_refused("lattice " + at("ball.stl") + " -o " + at("no/such/folder/x.h5"), ErrorKind::file, "x.h5");
}

}  // namespace
}  // namespace palpate
