#include "palpate/geometry/triangle_mesh.hpp"

#include <gtest/gtest.h>

namespace palpate {
namespace {

// Unit tetrahedron as four separate triangles: 12 vertices of which 4 are distinct.
TriangleMesh soup() {
  const std::array<Vec3, 4> p{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(-0.0, 0, 1)};
  TriangleMesh mesh;
  for (const auto& [a, b, c] :
       {std::array{0, 2, 1}, std::array{0, 1, 3}, std::array{1, 2, 3}, std::array{0, 3, 2}}) {
    const auto n = static_cast<Index>(mesh.vertices.size());
    for (const int i : {a, b, c}) mesh.vertices.push_back(p[static_cast<std::size_t>(i)]);
    mesh.triangles.push_back({n, n + 1, n + 2});
  }
  return mesh;
}

TEST(Weld, MergesDropsAndCounts) {
  TriangleMesh mesh = soup();
  mesh.vertices[4].x() = -0.0 + 1;           // the same place
  mesh.vertices.push_back(Vec3(9, 9, 9));    // unused
  mesh.vertices.push_back(Vec3(0.5, 0, 0));  // a sliver of zero area on an edge
  mesh.triangles.push_back({0, 2, 13});
  mesh.triangles.push_back({1, 1, 2});
  const WeldReport report = weld(mesh);
  EXPECT_EQ(report.welded, 8u);
  EXPECT_EQ(report.degenerate, 2u);
  EXPECT_EQ(report.unused, 2u);
  EXPECT_EQ(mesh.vertices.size(), 4u);
  EXPECT_EQ(mesh.triangles.size(), 4u);
  EXPECT_NEAR(volume(mesh), 1.0 / 6, 1e-15);
}

TEST(TriangleMesh, AreasSumToTheWhole) {
  TriangleMesh mesh = soup();
  weld(mesh);
  double sum = 0;
  for (const double a : vertex_areas(mesh)) sum += a;
  EXPECT_NEAR(sum, 1.5 + std::sqrt(3.0) / 2, 1e-14);
  for (const Vec3& n : vertex_normals(mesh)) EXPECT_NEAR(n.norm(), 1, 1e-14);
}

}  // namespace
}  // namespace palpate
