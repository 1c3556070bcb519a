#include "palpate/pad/pad.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "palpate/geometry/check.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/io/surface_file.hpp"

namespace palpate {
namespace {

std::vector<Triangle> sorted(const TriangleMesh& mesh, bool flip) {
  std::vector<Triangle> list = mesh.triangles;
  for (Triangle& t : list) {
    if (flip) std::swap(t[1], t[2]);
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  }
  std::sort(list.begin(), list.end());
  return list;
}

// What every padded surface owes: valid tetrahedra of the enclosed volume, the surface's vertices first and
// in order, no node idle, a boundary that is the surface.
void expect_sound(const TriangleMesh& surface, const Padded& padded) {
  ASSERT_NO_THROW(require_valid(padded.mesh, "padded"));
  EXPECT_EQ(padded.report.missing_triangles, 0u);
  EXPECT_NEAR(padded.report.quality.volume / std::abs(volume(surface)), 1, 1e-9);
  ASSERT_GE(padded.mesh.nodes.size(), surface.vertices.size());
  for (std::size_t i = 0; i < surface.vertices.size(); ++i)
    ASSERT_EQ(padded.mesh.nodes[i], surface.vertices[i]) << i;
  std::vector<int> used(padded.mesh.nodes.size(), 0);
  for (const Tetrahedron& t : padded.mesh.tets)
    for (const Index v : t) ++used[static_cast<std::size_t>(v)];
  EXPECT_EQ(std::count(used.begin(), used.end(), 0), 0);
  const Boundary b = boundary(padded.mesh);
  EXPECT_TRUE(check(b.surface).closed());
  EXPECT_TRUE(check(b.surface).oriented());
  ASSERT_EQ(b.nodes.size(), surface.vertices.size());
  for (std::size_t i = 0; i < b.nodes.size(); ++i) ASSERT_EQ(b.nodes[i], static_cast<Index>(i));
  EXPECT_EQ(sorted(b.surface, false), sorted(surface, volume(surface) < 0));
}

TEST(Pad, KidneyWithStone) {
  for (const int n : {600, 3000}) {
    const TriangleMesh kidney = make_kidney(n), stone = make_stone(n / 20);
    const Padded padded = pad_delaunay(kidney, {{"stone", stone}});
    expect_sound(kidney, padded);
    EXPECT_EQ(padded.report.region_missing, 0u);
    EXPECT_GE(padded.report.quality.min_dihedral, 10);
    EXPECT_LE(padded.report.quality.max_dihedral, 168);
    EXPECT_LT(padded.mesh.nodes.size(), 2.1 * static_cast<double>(kidney.vertices.size()));
    ASSERT_EQ(padded.mesh.region_names, (std::vector<std::string>{"tissue", "stone"}));
    double inside = 0;
    for (std::size_t t = 0; t < padded.mesh.tets.size(); ++t)
      if (padded.mesh.regions[t] == 1) inside += six_volume(padded.mesh, padded.mesh.tets[t]) / 6;
    EXPECT_NEAR(inside / volume(stone), 1, 1e-9);
  }
}

TEST(Pad, Sphere) {
  for (const int f : {1, 2, 6, 15}) {
    const TriangleMesh mesh = make_star_shaped(Vec3(1, 2, 3), f, [](const Vec3&) { return 0.05; });
    const Padded padded = pad_delaunay(mesh);
    expect_sound(mesh, padded);
    EXPECT_GE(padded.report.quality.min_dihedral, 15);
  }
}

// Quadrilaterals in one plane or on one circle, of which Delaunay picks any diagonal, and all points on a
// sphere.
TEST(Pad, SpecialPositions) {
  for (const int n : {1, 2, 5}) {
    SCOPED_TRACE(n);
    const TriangleMesh box = make_box({Vec3(0, 0, 0), Vec3(0.1, 0.1, 0.1)}, n);
    const Padded padded = pad_delaunay(box);
    expect_sound(box, padded);
    EXPECT_GE(padded.report.quality.min_dihedral, 5);
    const TriangleMesh sphere = make_sphere(Vec3::Zero(), 0.05, n + 4, 2 * n + 5);
    expect_sound(sphere, pad_delaunay(sphere));
  }
}

// Triangles of the surface that are not on the boundary are counted as they are: a square with its other
// diagonal.
TEST(Pad, MissingTrianglesAreCounted) {
  for (const int n : {7, 8, 9, 10}) {
    SCOPED_TRACE(n);
    const TriangleMesh box = make_box({Vec3(0, 0, 0), Vec3(0.1, 0.1, 0.1)}, n);
    const Padded padded = pad_delaunay(box);
    const std::vector<Triangle> now = sorted(boundary(padded.mesh).surface, false),
                                given = sorted(box, false);
    std::vector<Triangle> lost;
    std::set_difference(given.begin(), given.end(), now.begin(), now.end(), std::back_inserter(lost));
    EXPECT_EQ(padded.report.missing_triangles, lost.size());
    EXPECT_EQ(padded.report.missing_at.size(), lost.size());
    EXPECT_LE(lost.size(), 4u);
    EXPECT_NEAR(padded.report.quality.volume / 1e-3, 1, 1e-9);
  }
}

TEST(Pad, Torus) {
  for (const auto& [major, minor] : {std::pair{12, 4}, {40, 14}, {100, 33}}) {
    SCOPED_TRACE(major);
    const TriangleMesh mesh = make_torus(0.03, 0.01, major, minor);
    expect_sound(mesh, pad_delaunay(mesh));
  }
}

TEST(Pad, ThinPlate) {
  TriangleMesh plate = make_box({Vec3(0, 0, 0), Vec3(1, 1, 1)}, 12);
  for (Vec3& p : plate.vertices) p = p.cwiseProduct(Vec3(0.1, 0.1, 0.004));
  // Rows of squashed squares round the rim, each half the mean edge high or less.
  const Padded padded = pad_delaunay(plate);
  expect_sound(plate, padded);
}

// The chess piece of the thesis' fig. 6.1: long thin triangles, mirror symmetric.
TEST(Pad, Bishop) {
  const std::filesystem::path file = "/usr/share/inventor/data/models/chess/bishop.iv";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not there (Debian's inventor-data)";
  const TriangleMesh mesh = read_surface(file).mesh;
  if (!check(mesh).closed()) GTEST_SKIP() << "bishop.iv is open";
  expect_sound(mesh, pad_delaunay(mesh));
}

TEST(Pad, OrgansAndScans) {
  const char* given = std::getenv("PALPATE_DATA");
  const std::filesystem::path data = given ? given : PALPATE_SOURCE_DIR "/../shared/data";
  if (!std::filesystem::exists(data)) GTEST_SKIP() << data << " is not there; set PALPATE_DATA";
  for (const char* name : {"bench/hand_closed.obj", "organs/liver2.obj", "derived/VH_F_left_ventricle.stl"}) {
    SCOPED_TRACE(name);
    const TriangleMesh mesh = read_surface(data / name).mesh;
    const Padded padded = pad_delaunay(mesh);
    expect_sound(mesh, padded);
    EXPECT_GE(padded.report.quality.min_dihedral, 4);
  }
}

RC_GTEST_PROP(Pad, BumpySolids, ()) {
  const int f = *rc::gen::inRange(1, 9);
  const double bumps = *rc::gen::inRange(0, 40) / 100.0, x = *rc::gen::inRange(0, 60) / 10.0,
               y = *rc::gen::inRange(0, 60) / 10.0;
  const TriangleMesh mesh = make_star_shaped(Vec3(0.1, 0, 0), f, [&](const Vec3& d) {
    return 0.01 * (1 + bumps * std::sin(x * d.x() + y) * std::cos(y * d.y() - x * d.z()));
  });
  expect_sound(mesh, pad_delaunay(mesh));
}

TEST(Pad, GradedNeedsFewerNodesThanUniform) {
  const TriangleMesh kidney = make_kidney(1000);
  const Padded graded = pad_delaunay(kidney),
               uniform = pad_delaunay(kidney, {}, {PadMethod::delaunay, 0, 0, false, "tissue"});
  expect_sound(kidney, uniform);
  EXPECT_LT(3 * graded.report.interior_points, 2 * uniform.report.interior_points);
}

TEST(Pad, SpacingSetsTheInterior) {
  const TriangleMesh box = make_box({Vec3(0, 0, 0), Vec3(0.1, 0.1, 0.1)}, 1);
  PadOptions options;
  options.spacing = 0.012;
  options.grade = false;
  const Padded padded = pad_delaunay(box, {}, options);
  expect_sound(box, padded);
  EXPECT_GT(padded.report.interior_points, 400u);
  EXPECT_EQ(padded.report.spacing, 0.012);
}

TEST(Pad, RegionsNestAndMayTouch) {
  const TriangleMesh outer = make_box({Vec3(0, 0, 0), Vec3(1, 1, 1)}, 6);
  const TriangleMesh left = make_box({Vec3(0.25, 0.25, 0.25), Vec3(0.5, 0.75, 0.75)}, 4),
                     right = make_box({Vec3(0.5, 0.25, 0.25), Vec3(0.75, 0.75, 0.75)}, 4),
                     core = make_star_shaped(Vec3(0.375, 0.5, 0.5), 3, [](const Vec3&) { return 0.08; });
  const Padded padded = pad_delaunay(outer, {{"left", left}, {"right", right}, {"core", core}});
  expect_sound(outer, padded);
  EXPECT_EQ(padded.report.region_missing, 0u);
  std::vector<double> volumes(4, 0);
  for (std::size_t t = 0; t < padded.mesh.tets.size(); ++t)
    volumes[static_cast<std::size_t>(padded.mesh.regions[t])] +=
        six_volume(padded.mesh, padded.mesh.tets[t]) / 6;
  EXPECT_NEAR(volumes[0], 1 - 2 * 0.0625, 1e-12);
  EXPECT_NEAR(volumes[1], 0.0625 - volume(core), 1e-12);
  EXPECT_NEAR(volumes[2], 0.0625, 1e-12);
  EXPECT_NEAR(volumes[3], volume(core), 1e-12);
}

TEST(Pad, SurfaceWithACavity) {
  TriangleMesh mesh = make_star_shaped(Vec3::Zero(), 8, [](const Vec3&) { return 0.05; });
  TriangleMesh cavity = make_star_shaped(Vec3::Zero(), 5, [](const Vec3&) { return 0.03; });
  for (Triangle& t : cavity.triangles) std::swap(t[1], t[2]);
  append(mesh, cavity);
  expect_sound(mesh, pad_delaunay(mesh));
}

TEST(Pad, InwardFacingSurfaceIsTurnedOver) {
  TriangleMesh mesh = make_kidney(200);
  for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  const Padded padded = pad_delaunay(mesh);
  expect_sound(mesh, padded);
  EXPECT_TRUE(padded.report.flipped);
  EXPECT_FALSE(pad_delaunay(make_kidney(200)).report.flipped);
}

TEST(Pad, SameInputSameBits) {
  const TriangleMesh kidney = make_kidney(600), stone = make_stone(60);
  const Padded a = pad_delaunay(kidney, {{"stone", stone}}), b = pad_delaunay(kidney, {{"stone", stone}});
  EXPECT_EQ(a.mesh.nodes, b.mesh.nodes);
  EXPECT_EQ(a.mesh.tets, b.mesh.tets);
  EXPECT_EQ(a.mesh.regions, b.mesh.regions);
}

TEST(Pad, ScaleDoesNotMatter) {
  for (const double scale : {1e-6, 1e3}) {
    TriangleMesh mesh = make_kidney(200);
    for (Vec3& p : mesh.vertices) p = scale * p + Vec3(1, 2, 3) * scale;
    expect_sound(mesh, pad_delaunay(mesh));
  }
}

std::string message(ErrorKind kind, const TriangleMesh& mesh, const std::vector<NamedSurface>& inner = {},
                    const PadOptions& options = {}) {
  try {
    pad_delaunay(mesh, inner, options);
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), kind) << e.what();
    return e.what();
  }
  ADD_FAILURE() << "no error";
  return "";
}

TEST(Pad, BadSurfaces) {
  const ErrorKind g = ErrorKind::geometry;
  const TriangleMesh good = make_kidney(200);
  TriangleMesh bad = good;
  bad.triangles.pop_back();
  EXPECT_NE(message(g, bad).find("3 edges"), std::string::npos) << message(g, bad);
  bad = good, std::swap(bad.triangles[7][0], bad.triangles[7][1]);
  message(g, bad);
  bad = good, bad.vertices[5].x() = std::nan("");
  EXPECT_NE(message(g, bad).find("vertex 5"), std::string::npos);
  bad = good, bad.triangles[3][1] = 4711;
  EXPECT_NE(message(g, bad).find("4711"), std::string::npos);
  bad = good, bad.vertices.push_back(Vec3::Zero());
  EXPECT_NE(message(g, bad).find("no triangle uses vertex"), std::string::npos);
  bad = good, append(bad, good);
  EXPECT_NE(message(g, bad).find("same place"), std::string::npos);
  bad = good, append(bad, make_stone(40));  // an overlapping part: inside of the inside
  message(g, bad);
  TriangleMesh crossing = good, other = make_stone(40);
  for (Vec3& p : other.vertices) p.x() += 0.025;
  append(crossing, other);
  EXPECT_NE(message(g, crossing).find("run through"), std::string::npos) << message(g, crossing);
  message(g, {});
  message(g, {{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}, {{0, 1, 2}, {0, 2, 1}}});
  bad = good;
  for (Vec3& p : bad.vertices) p.z() = 0;  // squashed flat
  message(g, bad);
}

TEST(Pad, BadRegions) {
  const TriangleMesh kidney = make_kidney(200);
  TriangleMesh stone = make_stone(40);
  message(ErrorKind::usage, kidney, {{"", stone}});
  message(ErrorKind::usage, kidney, {{"tissue", stone}});
  message(ErrorKind::usage, kidney, {{"a", stone}, {"a", stone}});
  TriangleMesh away = stone;
  for (Vec3& p : away.vertices) p.x() += 0.2;
  EXPECT_NE(message(ErrorKind::geometry, kidney, {{"stone", away}}).find("leaves the outer"),
            std::string::npos);
  for (Vec3& p : away.vertices) p.x() -= 0.175;
  EXPECT_NE(message(ErrorKind::geometry, kidney, {{"stone", away}}).find("run through"), std::string::npos);
  stone.triangles.pop_back();
  EXPECT_NE(message(ErrorKind::geometry, kidney, {{"stone", stone}}).find("\"stone\" is open"),
            std::string::npos);
}

TEST(Pad, BadSpacing) {
  const TriangleMesh kidney = make_kidney(200);
  PadOptions options;
  for (const double spacing : {-1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    options.spacing = spacing;
    message(ErrorKind::usage, kidney, {}, options);
  }
  options.spacing = 1e-9;
  message(ErrorKind::resource, kidney, {}, options);
  options.spacing = 10;  // no interior at all is fine
  expect_sound(kidney, pad_delaunay(kidney, {}, options));
}

TEST(Pad, StopsWhenAskedTo) {
  std::atomic<bool> stop = true;
  Progress progress;
  progress.interrupted = &stop;
  EXPECT_THROW(pad_delaunay(make_kidney(200), {}, {}, progress), Error);
  double last = -1;
  progress.interrupted = nullptr;
  progress.report = [&](double f) { last = std::abs(f - 0.5) <= 0.5 ? f : 2; };
  pad_delaunay(make_kidney(200), {}, {}, progress);
  EXPECT_EQ(last, 1);
}

}  // namespace
}  // namespace palpate
