#include "palpate/pad/pad.hpp"

#include <gtest/gtest.h>

#include "palpate/geometry/check.hpp"
#include "palpate/geometry/shapes.hpp"

namespace palpate {
namespace {

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
  const auto sorted = [](const TriangleMesh& mesh, bool flip) {
    std::vector<Triangle> list = mesh.triangles;
    for (Triangle& t : list) {
      if (flip) std::swap(t[1], t[2]);
      std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    }
    std::sort(list.begin(), list.end());
    return list;
  };
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
  for (const int f : {2, 6, 15}) {
    const TriangleMesh mesh = make_star_shaped(Vec3(1, 2, 3), f, [](const Vec3&) { return 0.05; });
    expect_sound(mesh, pad_delaunay(mesh));
  }
}

TEST(Pad, Box) {
  for (const int n : {1, 5}) {
    const TriangleMesh mesh = make_box({Vec3(0, 0, 0), Vec3(0.1, 0.1, 0.1)}, n);
    expect_sound(mesh, pad_delaunay(mesh));
  }
}

TEST(Pad, Torus) {
  const TriangleMesh mesh = make_torus(0.03, 0.01, 40, 14);
  expect_sound(mesh, pad_delaunay(mesh));
}

}  // namespace
}  // namespace palpate
