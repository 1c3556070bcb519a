// The program itself: palpate info on files made here.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "run.hpp"
#include "unit/io/io_test.hpp"

namespace palpate {
namespace {

using nlohmann::json;

struct Info : ::testing::Test {
  TempFolder folder;
  Ran operator()(const std::string& name, const std::string& options = "") const {
    return run_palpate("info '" + (folder / name).string() + "' " + options);
  }
};

const std::string tetrahedron =
    "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 100\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

TEST_F(Info, ASurfaceAsLinesAndAsOneObject) {
  folder.write("a.obj", tetrahedron);
  const Ran lines = (*this)("a.obj", "--unit mm");
  EXPECT_EQ(lines.exit_code, 0);
  for (const char* part : {"4 triangles on 4 vertices, Wavefront OBJ", "100 x 100 x 100 mm",
                           "closed      yes", "oriented    yes, outwards", "166.667 cm3"})
    EXPECT_NE(lines.output.find(part), std::string::npos) << lines.output;
  const json object = json::parse((*this)("a.obj", "--json --unit mm").output);
  EXPECT_EQ(object["kind"], "surface");
  EXPECT_EQ(object["surface"]["closed"], true);
  EXPECT_NEAR(object["surface"]["volume_m3"].get<double>(), 1e-3 / 6, 1e-15);
}

TEST_F(Info, SaysWhatIsOpen) {
  folder.write("a.obj", tetrahedron.substr(0, tetrahedron.rfind('f')));
  const std::string output = (*this)("a.obj").output;
  EXPECT_NE(output.find("no: 3 open edges"), std::string::npos) << output;
  EXPECT_NE(output.find("--unit mm"), std::string::npos) << output;
}

TEST_F(Info, TetrahedraByRegion) {
  folder.write(
      "a.mesh",
      "MeshVersionFormatted 2\nDimension 3\nVertices\n5\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 1 1 0\n"
      "Tetrahedra\n2\n1 2 3 4 1\n2 3 4 5 2\nEnd\n");
  const Ran run = (*this)("a.mesh", "--json");
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const json object = json::parse(run.output);
  EXPECT_EQ(object["tets"], 2);
  EXPECT_EQ(object["regions"].size(), 2u);
  EXPECT_NEAR(object["regions"][0]["volume_m3"].get<double>(), 1.0 / 6, 1e-12);
  EXPECT_EQ(object["surface"]["triangles"], 6);
}

TEST_F(Info, FailsWithOneLineAndACode) {
  folder.write("a.obj", tetrahedron + "f 1 2 9\n");
  folder.write("a.xyz", "what is this");
  folder.write("\xff.obj", tetrahedron);
  struct Case {
    const char *file, *options;
    int code;
    const char* why;
  };
  for (const Case& c : {Case{"a.obj", "", 4, "line 9: there is no vertex 9"},
                        Case{"a.xyz", "", 4, "no surface format"}, Case{"none.stl", "", 3, "none.stl"},
                        Case{".", "", 3, "regular file"}, Case{"a.obj", "--unit parsec", 2, "parsec"}}) {
    const Ran run = (*this)(c.file, c.options);
    EXPECT_EQ(run.exit_code, c.code) << c.file;
    EXPECT_NE(run.output.find(c.why), std::string::npos) << run.output;
    EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
  }
  const Ran odd = (*this)("\xff.obj", "--json");  // a name that is no UTF-8 is no reason to fail
  EXPECT_EQ(odd.exit_code, 0) << odd.output;
  EXPECT_EQ(json::parse(odd.output)["surface"]["triangles"], 4);
}

}  // namespace
}  // namespace palpate
