#include "palpate/pad/flips.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "palpate/geometry/shapes.hpp"
#include "palpate/pad/improve.hpp"

namespace palpate {
namespace {

FlipMesh block(int n) {
  const TetMesh mesh = make_block({Vec3(0, 0, 0), Vec3(1, 1, 1)}, {n, n, n});
  return FlipMesh(mesh.nodes, mesh.tets);
}

double volume_of(const FlipMesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c, d] : mesh.tets())
    if (a >= 0)
      sum +=
          (mesh.node(b) - mesh.node(a)).cross(mesh.node(c) - mesh.node(a)).dot(mesh.node(d) - mesh.node(a)) /
          6;
  return sum;
}

std::vector<Tetrahedron> living(const FlipMesh& mesh) {
  std::vector<Tetrahedron> list;
  for (Tetrahedron t : mesh.tets()) {
    if (t[0] < 0) continue;
    std::sort(t.begin(), t.end());
    list.push_back(t);
  }
  std::sort(list.begin(), list.end());
  return list;
}

TEST(Flips, Shape) {
  const Vec3 a(1, 1, 1), b(-1, 1, -1), c(1, -1, -1), d(-1, -1, 1);
  EXPECT_NEAR(shape(a, b, c, d), 2 * std::numbers::sqrt2 / 3, 1e-14);  // sine of arccos(1/3)
  EXPECT_LT(shape(b, a, c, d), 0);
  EXPECT_NEAR(shape(1e-9 * a, 1e-9 * b, 1e-9 * c, 1e-9 * d), 2 * std::numbers::sqrt2 / 3, 1e-14);
  EXPECT_LE(shape(a, b, c, (a + b + c) / 3), 1e-14);
  EXPECT_EQ(shape(a, a, c, d), 0);
  // A corner cut off a cube has a right angle at three edges and 54.7 degrees at the others.
  EXPECT_NEAR(shape(Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)), std::sqrt(2.0 / 3), 1e-14);
}

TEST(Flips, RingGoesRoundTheEdge) {
  const FlipMesh mesh = block(2);
  const Index middle = 13;                               // of 27
  const std::vector<Index> ring = mesh.ring(0, middle);  // a cell's diagonal: six tetrahedra
  ASSERT_EQ(ring.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    const Vec3 &a = mesh.node(0), &b = mesh.node(middle);
    EXPECT_GT((b - a).cross(mesh.node(ring[i]) - a).dot(mesh.node(ring[(i + 1) % 6]) - a), 0);
  }
  EXPECT_TRUE(mesh.ring(0, 1).empty());   // on the boundary
  EXPECT_TRUE(mesh.ring(0, 26).empty());  // no edge
}

TEST(Flips, FacesKnowTheirSides) {
  const FlipMesh mesh = block(1);
  const Tetrahedron t = mesh.tet(0);  // (a, c, b) is seen from outside of (a, b, c, d)
  EXPECT_EQ(mesh.below(t[0], t[2], t[1]), 0);
  EXPECT_NE(mesh.below(t[0], t[1], t[2]), 0);
}

TEST(Flips, ThreeToTwoAndBack) {
  // Two tetrahedra on a triangle, apexes above and below.
  const std::vector<Vec3> p{Vec3(1, 0, 0), Vec3(-0.5, 0.9, 0), Vec3(-0.5, -0.9, 0), Vec3(0, 0, 1),
                            Vec3(0, 0, -1)};
  const std::vector<Tetrahedron> two{{0, 1, 2, 3}, {0, 2, 1, 4}};
  FlipMesh mesh(p, two);
  const double v = volume_of(mesh);
  ASSERT_TRUE(mesh.remove_face(0, 1, 2, 0));
  EXPECT_EQ(living(mesh).size(), 3u);
  EXPECT_TRUE(mesh.has_edge(3, 4));
  EXPECT_NEAR(volume_of(mesh), v, 1e-15);
  EXPECT_FALSE(mesh.remove_face(3, 4, 0, 0));  // its apexes share an edge already
  ASSERT_TRUE(mesh.remove_edge(3, 4, 0));
  EXPECT_EQ(living(mesh), (std::vector<Tetrahedron>{{0, 1, 2, 3}, {0, 1, 2, 4}}));
  mesh.protect_face(0, 1, 2);
  EXPECT_FALSE(mesh.remove_face(0, 1, 2, 0));
  EXPECT_TRUE(mesh.is_protected(1, 0));
}

TEST(Flips, NoFlipThatTurnsAnythingInsideOut) {
  // The apexes' line passes outside the triangle.
  const std::vector<Vec3> p{Vec3(1, 0, 0), Vec3(-0.5, 0.9, 0), Vec3(-0.5, -0.9, 0), Vec3(5, 0, 1),
                            Vec3(5, 0, -1)};
  const std::vector<Tetrahedron> two{{0, 1, 2, 3}, {0, 2, 1, 4}};
  FlipMesh mesh(p, two);
  EXPECT_FALSE(mesh.remove_face(0, 1, 2, 0));
  EXPECT_EQ(mesh.changes(), 0u);
}

// Any number of changes taken back gives the same tetrahedra under the same numbers.
TEST(Flips, UndoRestoresEverything) {
  FlipMesh mesh = block(3);
  const std::vector<Tetrahedron> before = mesh.tets();
  const std::size_t nodes = mesh.nodes.size();
  std::size_t done = 0;
  for (Index a = 0; a < 64; ++a)
    for (Index b = 0; b < 64; ++b) {
      if (a % 5 == 0 && b == a + 21) done += mesh.split_edge(a, b, (mesh.node(a) + mesh.node(b)) / 2) >= 0;
      if (a < b) done += mesh.remove_edge(a, b, 1e-6);
      if (a + 1 < b) done += mesh.remove_face(a, a + 1, b, 1e-6);
    }
  EXPECT_GT(done, 30u);
  EXPECT_EQ(mesh.changes(), done);
  EXPECT_NEAR(volume_of(mesh), 1, 1e-12);
  EXPECT_NE(living(mesh), living(block(3)));
  mesh.undo(0);
  EXPECT_EQ(mesh.tets(), before);
  EXPECT_EQ(mesh.nodes.size(), nodes);
  for (std::size_t v = 0; v < nodes; ++v) {
    std::size_t count = 0;
    for (const Tetrahedron& t : before) count += std::count(t.begin(), t.end(), static_cast<Index>(v));
    EXPECT_EQ(mesh.around(static_cast<Index>(v)).size(), count);
  }
}

TEST(Improve, GetsRidOfSliversAndKeepsTheBoundary) {
  FlipMesh mesh = block(4);
  // Interior nodes thrown about until tetrahedra are nearly flat.
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) {
    Vec3& p = mesh.nodes[i];
    if ((p.array() > 0.1).all() && (p.array() < 0.9).all())
      p += 0.1 * Vec3(std::sin(7.0 * static_cast<double>(i)), std::sin(11.0 * static_cast<double>(i)),
                      std::sin(13.0 * static_cast<double>(i)));
  }
  const auto worst = [&] {
    double least = 2;
    for (const Tetrahedron& t : mesh.tets())
      if (t[0] >= 0) least = std::min(least, mesh.shape_of(t));
    return least;
  };
  ASSERT_LT(worst(), 0.07);
  ASSERT_GT(worst(), 0);
  // Boundary nodes have the low numbers nowhere: only flips may work here.
  improve(mesh, static_cast<Index>(mesh.nodes.size()), 0.25);
  EXPECT_NEAR(volume_of(mesh), 1, 1e-12);
  EXPECT_GT(worst(), 0.08);
}

}  // namespace
}  // namespace palpate
