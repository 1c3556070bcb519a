#include "palpate/io/surface_file.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include "io_test.hpp"
#include "palpate/geometry/check.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/io/polygon.hpp"
#include "palpate/io/surface_formats.hpp"
#include "surface_samples.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

const fs::path models = "/usr/share/inventor/data/models";

// What reading `bytes` under this name says; empty when it succeeds.
std::string trouble(const std::string& name, const std::string& bytes, ErrorKind kind = ErrorKind::format) {
  const TempFolder folder;
  folder.write(name, bytes);
  try {
    read_surface(folder / name);
  } catch (const Error& e) {
    EXPECT_EQ(static_cast<int>(e.kind()), static_cast<int>(kind)) << e.what();
    const std::string text = e.what(), path = (folder / name).string() + ": ";
    EXPECT_EQ(text.substr(0, path.size()), path);
    EXPECT_EQ(text.find('\n'), text.npos) << text;
    return text.substr(std::min(text.size(), path.size()));
  }
  return "";
}
bool has(const std::string& text, const std::string& part) { return text.find(part) != text.npos; }
#define EXPECT_HAS(text, part) EXPECT_PRED2(has, text, part)

TEST(ReadSurface, EveryFormatGivesItsBody) {
  const TempFolder folder;
  for (const SurfaceSample& s : surface_samples()) {
    SCOPED_TRACE(s.name);
    folder.write(s.name, s.bytes);
    const SurfaceFile file = read_surface(folder / s.name, 2.0);
    const MeshReport report = check(file.mesh);
    EXPECT_EQ(report.vertices, s.vertices);
    EXPECT_EQ(report.triangles, s.triangles);
    EXPECT_TRUE(report.closed());
    EXPECT_TRUE(report.oriented());
    EXPECT_NEAR(report.volume, 8 * s.volume, 1e-6 * s.volume);
  }
}

TEST(ReadSurface, ContentComesBeforeTheExtension) {
  const TempFolder folder;
  for (const SurfaceSample& s : surface_samples()) {
    const std::string extension = fs::path(s.name).extension();
    if (extension == ".obj" || extension == ".gltf") continue;  // no mark at the beginning
    SCOPED_TRACE(s.name);
    folder.write("surface.dat", s.bytes);
    EXPECT_EQ(read_surface(folder / "surface.dat").mesh.triangles.size(), s.triangles);
  }
}

TEST(ReadSurface, TorusAndBishopOfInventorData) {
  if (!fs::exists(models)) GTEST_SKIP() << "Debian's inventor-data is not installed";
  const SurfaceFile torus = read_surface(models / "torus.iv");
  EXPECT_EQ(torus.format, "Open Inventor");
  const MeshReport report = check(torus.mesh);
  EXPECT_TRUE(report.closed() && report.oriented());
  EXPECT_EQ(report.vertices, 576u);
  EXPECT_EQ(report.triangles, 1152u);
  EXPECT_NEAR(report.volume, 4.59318e-4, 1e-9);
  const MeshReport bishop = check(read_surface(models / "chess/bishop.iv", 10).mesh);
  EXPECT_TRUE(bishop.closed() && bishop.oriented());
  EXPECT_EQ(bishop.vertices, 250u);
  EXPECT_EQ(bishop.triangles, 496u);
  EXPECT_NEAR(bishop.volume, 2.4617e-2, 1e-6);
  EXPECT_EQ(kind_of([] { read_surface(models / "household/teapot.iv"); }), ErrorKind::format);
}

TEST(ReadSurface, FilesThatAreNone) {
  const TempFolder folder;
  EXPECT_EQ(kind_of([&] { read_surface(folder / "missing.obj"); }), ErrorKind::file);
  EXPECT_EQ(kind_of([&] { read_surface(folder.path); }), ErrorKind::file);
  EXPECT_EQ(kind_of([&] { read_surface("/dev/zero"); }), ErrorKind::file);
  for (const char* name : {"a.obj", "a.stl", "a.ply", "a.iv", "a.glb", "a.xyz", "a"}) {
    EXPECT_HAS(trouble(name, ""), "empty");
    EXPECT_NE(trouble(name, "nothing of the kind\n"), "");
  }
  EXPECT_HAS(trouble("a.xyz", "1 2 3\n"), "no surface format");
}

TEST(Inventor, RefusesWhatCoinWouldReadWrongly) {
  const std::string head = "#Inventor V2.1 ascii\n",
                    point = "Coordinate3 { point [ 0 0 0, 1 0 0, 0 1 0, 0 0 1 ] }\n";
  EXPECT_HAS(trouble("a.iv", head + point + "IndexedFaceSet { coordIndex [ 0,1,4,-1 ] }"), "point 4 of 4");
  EXPECT_HAS(trouble("a.iv", head + point + "IndexedFaceSet { coordIndex [ 0,1,-1, 0,1,2,-1 ] }"),
             "2 corners");
  EXPECT_HAS(trouble("a.iv", head + "IndexedFaceSet { coordIndex [ 0,1,2 ] }"), "IndexedFaceSet");
  EXPECT_HAS(trouble("a.iv", head + point + "IndexedTriangleStripSet { coordIndex [ 0,1,2,7 ] }"), "point 7");
  EXPECT_HAS(trouble("a.iv", head + point + "TriangleStripSet { numVertices [ 4, 3 ] }"), "7 points of 4");
  EXPECT_HAS(trouble("a.iv", head + point + "FaceSet { startIndex 2 numVertices 3 }"), "5 points of 4");
  EXPECT_HAS(trouble("a.iv", head + point + "QuadMesh { verticesPerRow 3 verticesPerColumn 2 }"), "2 x 3");
  EXPECT_HAS(trouble("a.iv", head + "Cube {} NurbsSurface { numUControlPoints 4 }"), "NURBS");
  EXPECT_HAS(
      trouble("a.wrl", "#VRML V2.0 utf8\nShape { geometry ElevationGrid { xDimension 9 zDimension 9 } }"),
      "9 x 9");
}

TEST(Inventor, ReadErrorsAreNotHalfAMesh) {
  const std::string head = "#Inventor V2.1 ascii\n";
  EXPECT_HAS(trouble("a.iv", head + "Cube {}\nSeparator { Cube {}"), "Premature end");
  EXPECT_HAS(trouble("a.iv", head + "Cube {}\nSeparator { Cube { widht 3 } }"), "widht");
  EXPECT_HAS(trouble("a.iv", head + "Cube {}\nFrobnicate { a 3 }"), "Frobnicate");
  EXPECT_HAS(trouble("a.iv", head + "Cube {}\nFile { name \"none.iv\" }"), "none.iv");
  EXPECT_HAS(trouble("a.iv", "#Inventor V9.9 ascii\nCube {}"), "version");
  EXPECT_HAS(trouble("a.iv", "Cube {}"), "version");
  EXPECT_HAS(trouble("a.iv", head), "no polygons");
  EXPECT_HAS(trouble("a.iv", head + "Text3 { string \"abc\" }"), "no polygons");
  EXPECT_EQ(trouble("a.iv", head + "Texture2 { filename \"none.rgb\" } Cube {}"), "");
}

TEST(Inventor, DeathOfTheReaderIsANamedError) {
  std::string deep = "#Inventor V2.1 ascii\n";
  for (int i = 0; i < 200000; ++i) deep += "Separator{";
  EXPECT_HAS(trouble("a.iv", deep), "died on it (segmentation fault)");
}

TEST(Inventor, SpheresAreClosed) {
  const TempFolder folder;
  for (const char* scene :
       {"Sphere { radius 2 }", "Complexity { value 1 } Translation { translation 50 0 9 } Sphere {}",
        "Complexity { type SCREEN_SPACE value .3 } Sphere {}", "Cone {}", "Cylinder {}"}) {
    SCOPED_TRACE(scene);
    folder.write("a.iv", std::string("#Inventor V2.1 ascii\n") + scene);
    const MeshReport report = check(read_surface(folder / "a.iv").mesh);
    EXPECT_TRUE(report.closed() && report.oriented());
    EXPECT_GT(report.volume, 2);
  }
}

TEST(Gltf, SaysWhatIsWrong) {
  EXPECT_HAS(trouble("a.glb", glb(R"({"mesh":0})", 4, {0, 2, 1, 0, 1, 9, 1, 2, 3, 0, 3, 2})), "not there");
  EXPECT_HAS(trouble("a.glb", glb(R"({"mesh":0})", 1)), "no polygons");
  EXPECT_HAS(trouble("a.glb", glb(R"({"mesh":0,"name":"KHR_mesh_quantization"})")), "KHR_mesh_quantization");
  EXPECT_HAS(trouble("a.glb", glb(R"({"children":[0]})")), "recursive");
  EXPECT_HAS(trouble("a.glb", glb(R"({"mesh":0})").substr(0, 300)), "truncated");
  std::string nan = glb(R"({"mesh":0})");
  nan.replace(nan.find("BIN") + 4 + 12, 4, std::string("\0\0\xc0\x7f", 4));
  EXPECT_HAS(trouble("a.glb", nan), "vertex 1 of triangle 0 is at (nan");
}

TEST(Obj, NamesLineAndTrouble) {
  const std::string v = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  EXPECT_HAS(trouble("a.obj", v + "f 1 2 4\n"), "line 4: there is no vertex 4; the file has 3");
  EXPECT_HAS(trouble("a.obj", v + "f 1 2 3\nf 1 2 -4\n"), "line 5: there is no vertex -4");
  EXPECT_HAS(trouble("a.obj", v + "f 0 1 2\n"), "line 4: \"0\"");
  EXPECT_HAS(trouble("a.obj", v + "f 1 2\n"), "line 4: a face with 2 corners");
  EXPECT_HAS(trouble("a.obj", v + "f 1 2 x/1\n"), "line 4: \"x/1\"");
  EXPECT_HAS(trouble("a.obj", "v 0 0\n" + v + "f 1 2 3\n"), "line 1: a vertex without its three");
  EXPECT_HAS(trouble("a.obj", v + "v 0 nan 0\nf 1 2 3\n"), "line 4: expected a finite number, found \"nan\"");
  EXPECT_HAS(trouble("a.obj", v + "v 0 1e999 0\nf 1 2 3\n"), "1e999");
  EXPECT_HAS(trouble("a.obj", v + "v 0 1e99 0\nf 1 2 4\n"), "vertex 3 of triangle 0 is at (0, 1e+99, 0)");
  EXPECT_HAS(trouble("a.obj", v), "no polygons");
  EXPECT_HAS(trouble("a.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"), "none of its 1 triangles has an area");
  EXPECT_EQ(trouble("a.obj", "f 1 2 3\n" + v), "");  // vertices may come later
}

TEST(Stl, NamesFacetAndTrouble) {
  const auto sample = [](const std::string& name) {
    for (const SurfaceSample& s : own_surface_samples())
      if (s.name == name) return s.bytes;
    return std::string();
  };
  std::string binary = sample("binary.stl"), text = sample("text.stl");
  EXPECT_HAS(trouble("a.stl", binary.substr(0, binary.size() - 1)), "says it has 4 triangles but holds 3");
  EXPECT_HAS(trouble("a.stl", binary + binary), "says it has 4 triangles but holds 9");
  EXPECT_EQ(trouble("a.stl", binary + "padding"), "");
  binary[80] = '\xff', binary[83] = '\xff';
  EXPECT_HAS(trouble("a.stl", binary), "says it has 4278190335 triangles");
  EXPECT_HAS(trouble("a.stl", text.substr(0, text.find("endsolid"))), "the file ends early");
  EXPECT_HAS(trouble("a.stl", "solid\nfacet\nouter loop\nvertex 0 0 0\nendloop\nendfacet\nendsolid\n"),
             "line 5, facet 0: expected \"vertex\", found \"endloop\"");
  EXPECT_HAS(trouble("a.stl", "solid\nfacet\nouter loop\nvertex 0 0 1e39\n"), "float32");
  for (std::size_t i = 0; i < 9; ++i) {  // whichever coordinate it is
    std::string nan = sample("binary.stl");
    nan.replace(96 + 4 * i, 4, std::string("\0\0\xc0\x7f", 4));
    EXPECT_HAS(trouble("a.stl", nan), "of triangle 0 is at (");
  }
}

std::string ply(const std::string& rest) { return "ply\nformat ascii 1.0\n" + rest; }

TEST(Ply, NamesElementAndTrouble) {
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  const std::string face = "property list uchar int vertex_indices\nend_header\n";
  const std::string three =
      ply("element vertex 3\n" + xyz + "element face 1\n" + face + "0 0 0\n1 0 0\n0 1 0\n");
  EXPECT_EQ(trouble("a.ply", three + "3 0 1 2\n"), "");
  EXPECT_HAS(trouble("a.ply", three + "3 0 1 3\n"), "a face uses vertex 3");
  EXPECT_HAS(trouble("a.ply", three + "3 0 1 -1\n"), "line 13, face 0: there is no vertex -1");
  EXPECT_HAS(trouble("a.ply", three + "3 0 1 0.5\n"), "0.5 is no whole number");
  EXPECT_HAS(trouble("a.ply", three + "2 0 1\n"), "2 corners");
  EXPECT_HAS(trouble("a.ply", three + "-1\n"), "count of -1");
  EXPECT_HAS(trouble("a.ply", three + "4000000000 0 1 2\n"), "count of 4000000000");
  EXPECT_HAS(trouble("a.ply", three), "face");
  EXPECT_HAS(trouble("a.ply", three + "3 0 1 2\n7\n"), "more follows");
  EXPECT_HAS(trouble("a.ply", three + "3 0 1 2"), "cut");
  EXPECT_HAS(trouble("a.ply", ply("element vertex 9000000000000000000\n" + xyz + "end_header\n0 0 0\n")),
             "count of 9");
  EXPECT_HAS(trouble("a.ply", ply("element vertex 1\nproperty float x\nend_header\n0\n")), "no property y");
  EXPECT_HAS(trouble("a.ply", ply("element vertex 1\nproperty flot x\nend_header\n0\n")),
             "\"flot\" is no type");
  EXPECT_HAS(trouble("a.ply", ply("property float x\nend_header\n")), "before the first element");
  EXPECT_HAS(trouble("a.ply", ply("element vertex 1\n")), "the file ends early");
  EXPECT_HAS(trouble("a.ply", "ply\nelement vertex 0\nend_header\n"), "no format");
  EXPECT_HAS(trouble("a.ply", "ply\nformat utf8 1.0\nend_header\n"), "\"utf8\"");
}

// Signed area of triangles in the plane z = 0.
double area(const TriangleMesh& mesh) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles) {
    const double a = area_vector(mesh, t).z();
    EXPECT_GT(a, 0);
    sum += a;
  }
  return sum;
}

TEST(Polygon, ConcaveOnesAreClipped) {
  const std::vector<std::pair<std::vector<Vec3>, double>> cases{
      {{{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, .5, 0}, {0, 2, 0}}, 2.5},          // a notch
      {{{1, .5, 0}, {0, 2, 0}, {0, 0, 0}, {2, 0, 0}, {2, 2, 0}}, 2.5},          // begun at the notch
      {{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {0, 1, 0}}, 4},  // corners in a line
      {{{0, 0, 0},
        {4, 0, 0},
        {4, 4, 0},
        {0, 4, 0},
        {0, 0, 0},
        {1, 1, 0},
        {1, 3, 0},
        {3, 3, 0},
        {3, 1, 0},
        {1, 1, 0}},
       12},                                                   // a hole and its bridge
      {{{0, 0, 0}, {2, 1, 0}, {0, 2, 0}, {.5, 1, 0}}, 1.5}};  // an arrow head
  for (const auto& [points, expected] : cases) {
    TriangleMesh mesh{points, {}};
    std::vector<Index> corners;
    for (std::size_t i = 0; i < points.size(); ++i) corners.push_back(static_cast<Index>(i));
    Triangulator().add(corners, mesh.vertices, mesh.triangles);
    EXPECT_EQ(mesh.triangles.size(), points.size() - 2);
    EXPECT_NEAR(area(mesh), expected, 1e-12);
  }
}

TEST(Polygon, AHugeKnotEndsSoon) {
  TriangleMesh mesh;
  std::vector<Index> corners;
  for (int i = 0; i < 200000; ++i) {
    corners.push_back(i);
    mesh.vertices.emplace_back(std::cos(i * 2.4), std::sin(i * 2.4), 0.1 * std::sin(i));
  }
  Triangulator().add(corners, mesh.vertices, mesh.triangles);
  EXPECT_EQ(mesh.triangles.size(), corners.size() - 2);
}

RC_GTEST_PROP(WriteSurface, ReadsBackExactly, ()) {
  TriangleMesh mesh;
  const auto coordinate = rc::gen::map(rc::gen::inRange<std::int64_t>(-1000000007, 1000000007),
                                       [](std::int64_t i) { return static_cast<double>(i) / 3e6; });
  for (int i = 0, n = *rc::gen::inRange(3, 30); i < n; ++i)
    mesh.vertices.emplace_back(*coordinate, *coordinate, *coordinate);
  for (Index i = 0; i + 2 < static_cast<Index>(mesh.vertices.size()); ++i)
    mesh.triangles.push_back({i, i + 1, i + 2});
  weld(mesh);
  RC_PRE(!mesh.triangles.empty());
  const TempFolder folder;
  for (const char* name : {"a.obj", "a.ply", "a.STL"}) {
    write_surface(folder / name, mesh);
    const SurfaceFile file = read_surface(folder / name);
    RC_ASSERT(folder.files() == 1u);
    fs::remove(folder / name);
    if (file.format != "STL") {
      RC_ASSERT(file.mesh.vertices == mesh.vertices);
      RC_ASSERT(file.mesh.triangles == mesh.triangles);
    } else if (file.mesh.triangles.size() == mesh.triangles.size()) {  // none became flat in float32
      for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        for (std::size_t i = 0; i < 3; ++i)
          RC_ASSERT(file.mesh.vertices[file.mesh.triangles[t][i]].cast<float>() ==
                    mesh.vertices[mesh.triangles[t][i]].cast<float>());
    }
  }
}

TEST(WriteSurface, UnitsAndRefusals) {
  const TempFolder folder;
  TriangleMesh mesh{{{0, 0, 0}, {0.001, 0, 0}, {0, 0.002, 0}}, {{0, 1, 2}}};
  write_surface(folder / "a.obj", mesh, unit_in_metres("mm"));
  EXPECT_HAS(read_file(folder / "a.obj"), "v 1 0 0");
  EXPECT_NEAR((read_surface(folder / "a.obj", 1e-3).mesh.vertices[2] - mesh.vertices[2]).norm(), 0, 1e-18);
  EXPECT_EQ(kind_of([&] { write_surface(folder / "a.xyz", mesh); }), ErrorKind::usage);
  EXPECT_EQ(kind_of([&] { write_surface(folder / "none" / "a.obj", mesh); }), ErrorKind::file);
  EXPECT_EQ(unit_in_metres("in"), 0.0254);
  EXPECT_EQ(kind_of([] { unit_in_metres("parsec"); }), ErrorKind::usage);
  EXPECT_EQ(folder.files(), 1u);
}

}  // namespace
}  // namespace palpate
