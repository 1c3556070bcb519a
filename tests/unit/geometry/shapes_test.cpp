#include "palpate/geometry/shapes.hpp"

#include <gtest/gtest.h>

#include <map>
#include <numbers>

namespace palpate {
namespace {

constexpr double pi = std::numbers::pi;

// Every directed edge once, and its reverse once.
bool closed_and_oriented(const TriangleMesh& mesh) {
  std::map<std::pair<Index, Index>, int> edges;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k)
      if (edges[{t[k], t[(k + 1) % 3]}]++) return false;
  for (const auto& [edge, count] : edges)
    if (!edges.count({edge.second, edge.first})) return false;
  return !edges.empty();
}

double area(const TriangleMesh& mesh) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles) sum += area_vector(mesh, t).norm();
  return sum;
}

double distance(const TriangleMesh& a, const TriangleMesh& b) {
  double least = std::numeric_limits<double>::infinity();
  for (const Vec3& p : a.vertices)
    for (const Vec3& q : b.vertices) least = std::min(least, (p - q).norm());
  return least;
}

// Longest by shortest edge, of all and of the worst single triangle.
std::pair<double, double> edge_ratios(const TriangleMesh& mesh) {
  double low = 1e9, high = 0, worst = 0;
  for (const Triangle& t : mesh.triangles) {
    std::array<double, 3> l;
    for (std::size_t k = 0; k < 3; ++k)
      l[k] = (mesh.vertices[static_cast<std::size_t>(t[k])] -
              mesh.vertices[static_cast<std::size_t>(t[(k + 1) % 3])])
                 .norm();
    const auto [least, most] = std::minmax_element(l.begin(), l.end());
    low = std::min(low, *least), high = std::max(high, *most), worst = std::max(worst, *most / *least);
  }
  return {high / low, worst};
}

TEST(Shapes, Sphere) {
  const TriangleMesh mesh = make_sphere(Vec3(1, 2, 3), 0.5, 60, 120);
  EXPECT_TRUE(closed_and_oriented(mesh));
  EXPECT_EQ(mesh.vertices.size(), 59u * 120 + 2);
  EXPECT_NEAR(volume(mesh), 4 * pi / 3 * 0.125, 2e-3 * 0.5);
  EXPECT_NEAR(area(mesh), pi, 3e-3);
  EXPECT_NEAR((bounding_box(mesh.vertices).center() - Vec3(1, 2, 3)).norm(), 0, 1e-12);
}

TEST(Shapes, Torus) {
  const TriangleMesh mesh = make_torus(0.03, 0.01, 120, 60);
  EXPECT_TRUE(closed_and_oriented(mesh));
  EXPECT_EQ(mesh.vertices.size(), 7200u);
  EXPECT_NEAR(volume(mesh) / (2 * pi * pi * 0.03 * 1e-4), 1, 5e-3);
  EXPECT_NEAR(area(mesh) / (4 * pi * pi * 3e-4), 1, 3e-3);
  EXPECT_NEAR(bounding_box(mesh.vertices).size().y(), 0.02, 1e-9);
}

TEST(Shapes, Box) {
  for (const int n : {1, 3, 7}) {
    const TriangleMesh mesh = make_box({Vec3(-0.1, 0.3, 1e3), Vec3(0.2, 0.35, 1e3 + 0.7)}, n);
    EXPECT_TRUE(closed_and_oriented(mesh)) << n;
    EXPECT_EQ(mesh.vertices.size(), static_cast<std::size_t>(6 * n * n + 2));
    EXPECT_NEAR(volume(mesh), 0.3 * 0.05 * 0.7, 1e-9);
    EXPECT_NEAR(area(mesh), 2 * (0.3 * 0.05 + 0.05 * 0.7 + 0.3 * 0.7), 1e-9);
  }
}

TEST(Shapes, StarShaped) {
  for (const int f : {1, 2, 5, 20}) {
    const TriangleMesh mesh = make_star_shaped(Vec3(1, 0, 0), f, [](const Vec3&) { return 2.0; });
    EXPECT_TRUE(closed_and_oriented(mesh)) << f;
    EXPECT_EQ(mesh.vertices.size(), static_cast<std::size_t>(10 * f * f + 2));
    EXPECT_LT(edge_ratios(mesh).first, 1.35);
    for (const Vec3& p : mesh.vertices) EXPECT_NEAR((p - Vec3(1, 0, 0)).norm(), 2, 1e-12);
  }
  const TriangleMesh fine = make_star_shaped(Vec3::Zero(), 30, [](const Vec3&) { return 1.0; });
  EXPECT_NEAR(volume(fine) / (4 * pi / 3), 1, 3e-3);
}

TEST(Shapes, KidneyIsClosedEvenAndOfItsSize) {
  for (const int n : {150, 600, 3000}) {
    const TriangleMesh mesh = make_kidney(n);
    EXPECT_TRUE(closed_and_oriented(mesh)) << n;
    EXPECT_GE(mesh.vertices.size(), static_cast<std::size_t>(n));
    EXPECT_LE(static_cast<double>(mesh.vertices.size()), 1.35 * n);
    const auto [all, single] = edge_ratios(mesh);
    EXPECT_LT(all, n < 600 ? 5.0 : 4.0) << n;
    EXPECT_LT(single, 2.5) << n;
    const Vec3 size = bounding_box(mesh.vertices).size();
    EXPECT_NEAR((size.array() / Vec3(0.06, 0.12, 0.05).array() - 1).abs().maxCoeff(), 0,
                n < 600 ? 0.03 : 0.005);
    EXPECT_NEAR(volume(mesh), 1.85e-4, 0.1e-4);
  }
}

// Along the middle line the hilum side (+x) lies deeper at half height than towards the poles, and the other
// side is convex.
TEST(Shapes, KidneyIsABean) {
  const TriangleMesh mesh = make_kidney(5000);
  const auto side = [&](double y, double sign) {
    double x = -1;
    for (const Vec3& p : mesh.vertices)
      if (std::abs(p.y() - y) < 0.003 && std::abs(p.z()) < 0.004) x = std::max(x, sign * p.x());
    return x;
  };
  EXPECT_LT(side(0, 1) + 0.008, side(0.035, 1));
  EXPECT_LT(side(0, 1) + 0.008, side(-0.035, 1));
  EXPECT_GT(side(0, -1), side(0.035, -1));
  EXPECT_GT(side(0, -1), side(-0.035, -1));
}

TEST(Shapes, StoneLiesInTheLowerHalf) {
  for (const int n : {12, 100, 400}) {
    const TriangleMesh stone = make_stone(n), kidney = make_kidney(3000);
    EXPECT_TRUE(closed_and_oriented(stone));
    EXPECT_GE(stone.vertices.size(), static_cast<std::size_t>(n));
    EXPECT_LT(bounding_box(stone.vertices).max.y(), 0);
    EXPECT_NEAR(bounding_box(stone.vertices).size().maxCoeff(), 0.015, 0.0015);
    EXPECT_GT(distance(stone, kidney), 0.008);
    EXPECT_GT(volume(stone), 0.7e-6);
  }
}

TEST(Shapes, Block) {
  const TetMesh mesh = make_block({Vec3(0, -1, 2), Vec3(2, 0, 5)}, {2, 3, 4});
  EXPECT_EQ(mesh.nodes.size(), 60u);
  EXPECT_EQ(mesh.tets.size(), 144u);
  require_valid(mesh, "block");
  EXPECT_NEAR(quality(mesh).volume, 6, 1e-12);
  const TriangleMesh surface = boundary(mesh).surface;
  EXPECT_TRUE(closed_and_oriented(surface));  // cells fit together
  EXPECT_EQ(surface.triangles.size(), 4u * (6 + 8 + 12));
  EXPECT_NEAR(volume(surface), 6, 1e-12);
}

}  // namespace
}  // namespace palpate
