#include "palpate/contact/path.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <random>

#include "palpate/geometry/shapes.hpp"

namespace palpate {
namespace {

const Pose somewhere{Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized())), Vec3(1, 2, 3)};

Shape lattice_box(const Vec3& half, double h) {
  const TriangleMesh box = make_box({-half, half});
  return std::make_shared<const Lattice>(
      sample_lattice(SignedDistanceField(box), make_grid_spaced(bounding_box(box.vertices), h, 2 * h)));
}

// From `from` to `to`, both in the shape's frame.
Gap reached(const Shape& shape, const Vec3& from, const Vec3& to, Path* gone = nullptr) {
  const PlacedShape placed(shape, somewhere);
  Gap g = gap_by_path(placed, path_from(placed, from), somewhere * to, gone);
  g.normal = somewhere.rotation.conjugate() * g.normal;
  return g;
}

// A 1 mm blade, its flat sides across x, its edges across z.
const Vec3 blade_half(0.5e-3, 10e-3, 20e-3);
std::vector<Shape> blades() { return {Cuboid{blade_half}, lattice_box(blade_half, 0.25e-3)}; }
double roundness(const Shape& blade) { return blade.index() == 2 ? 1e-9 : 0.05e-3; }  // of the lattice

TEST(Path, KeepsABladesSideAtAnyDepth) {
  for (const Shape& blade : blades())
    for (const double start : {0.501e-3, 0.7e-3, 3e-3})
      for (double x = 0.45e-3; x > -6e-3; x -= 0.11e-3) {
        const Gap g = reached(blade, Vec3(start, 1e-3, 2e-3), Vec3(x, 2e-3, 1e-3));
        EXPECT_NEAR(g.distance, x - 0.5e-3, roundness(blade)) << x;
        EXPECT_GT(g.normal.x(), 0.99) << x;
      }
}

TEST(Path, AnEdgeThatRushesInPushesAhead) {
  for (const Shape& blade : blades())
    for (const double x : {-0.3e-3, 0.0, 0.1e-3, 0.4e-3})  // the lattice's edge is flat in its middle only
      for (const double deep : {0.2e-3, 1e-3, 5e-3, 12e-3}) {
        if (blade.index() != 2 && std::abs(x) > 0.2e-3) continue;
        const Gap g = reached(blade, Vec3(x, 0, 20.5e-3), Vec3(x, 0, 20e-3 - deep));
        EXPECT_NEAR(g.distance, -deep, 2 * roundness(blade)) << x << ' ' << deep;
        EXPECT_GT(g.normal.z(), 0.9) << x << ' ' << deep;
      }
}

// Round an edge, step by step, and back: wherever the point is outside or on the surface, the gap is the
// plain one.
TEST(Path, SlidesRoundAnEdge) {
  for (const Shape& blade : blades())
    for (const double step : {0.1e-3, 0.4e-3, 2e-3}) {
      const PlacedShape placed(blade, somewhere);
      const Vec3 way[] = {Vec3(0.6e-3, 0, 15e-3), Vec3(0.6e-3, 0, 21e-3), Vec3(-0.6e-3, 0, 21e-3),
                          Vec3(-0.6e-3, 0, 15e-3)};
      Path path = path_from(placed, way[0]);
      for (int leg = 0; leg < 3; ++leg)
        for (double t = 0; t < 1; t += step / (way[leg + 1] - way[leg]).norm()) {
          const Vec3 p = somewhere * Vec3(way[leg] + t * (way[leg + 1] - way[leg]));
          EXPECT_EQ(gap_by_path(placed, path, p, &path).distance, placed.distance(p));
        }
      const Gap g = gap_by_path(placed, path, somewhere * Vec3(0.2e-3, 0, 15e-3));
      EXPECT_LT((somewhere.rotation.conjugate() * g.normal).x(), -0.99);  // it is on the other side now
      EXPECT_NEAR(g.distance, -0.7e-3, roundness(blade));
    }
}

// Into a thick body, not deep: the plain gap, bit by bit, however long the way was.
TEST(Path, IsThePlainGapOfThickBodies) {
  const TriangleMesh torus = make_torus(0.03, 0.012, 60, 30);
  const Shape shapes[] = {
      Sphere{0.02}, Capsule{0.01, 0.02}, Cuboid{Vec3(0.02, 0.03, 0.01)}, HalfSpace{},
      std::make_shared<const Lattice>(sample_lattice(
          SignedDistanceField(torus), make_grid_spaced(bounding_box(torus.vertices), 1e-3, 2e-3)))};
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(-0.05, 0.05);
  int inside = 0;
  for (const Shape& shape : shapes) {
    const PlacedShape placed(shape, somewhere);
    for (int k = 0; k < 4000; ++k) {
      const Vec3 p(share(random), share(random), share(random));
      const Gap plain = gap(shape, p);
      if (plain.distance < -3e-3) continue;
      for (const double off : {1e-6, 1e-3, 10e-3}) {
        const Vec3 from = p + (off - plain.distance) * plain.normal;
        if (distance(shape, from) < 0.9 * off) continue;  // across the torus's hole
        const Gap g = reached(shape, from, p);
        EXPECT_EQ(g.distance, gap(shape, placed.own(somewhere * p)).distance);
        EXPECT_GT(g.normal.dot(plain.normal), 1 - 1e-9);
        inside += plain.distance < 0;
      }
    }
  }
  EXPECT_GT(inside, 300);
}

// The gap's change is that of the place: no jumps along a way into a blade, wherever it came from. (From a
// rounded edge a point slides off: there is one.)
TEST(Path, HasNoJumps) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> share(-1, 1);
  for (const Shape& blade : {Shape{Cuboid{blade_half}}})
    for (int k = 0; k < 1000; ++k) {
      const Vec3 from(2e-3 * share(random), 8e-3 * share(random), 25e-3 + 5e-3 * share(random));
      if (distance(blade, from) < 0) continue;
      const Vec3 to(0.2e-3 * share(random), 8e-3 * share(random), 15e-3);
      const double first = reached(blade, from, from + 0.99 * (to - from)).distance,
                   second = reached(blade, from, from + 1.00 * (to - from)).distance;
      EXPECT_LE(std::abs(first - second), 1.2 * 0.01 * (to - from).norm() + roundness(blade))
          << from.transpose() << " to " << to.transpose();
    }
}

TEST(Path, WhatBeganInsideHasNone) {
  const Shape ball = Sphere{1e-3};
  EXPECT_FALSE(path_from(PlacedShape(ball, somewhere), Vec3(0, 0, 0.5e-3)).known);
  Path gone;
  EXPECT_NEAR(reached(ball, Vec3(0, 0, 0.5e-3), Vec3(0, 0, -0.9e-3), &gone).distance, -0.1e-3, 1e-12);
  EXPECT_FALSE(gone.known);
}

TEST(Path, PassingIsSeen) {
  const Shape sheet = Cuboid{Vec3(0.1e-3, 10e-3, 10e-3)};
  EXPECT_TRUE(passes(sheet, Vec3(3e-3, 0, 0), Vec3(-2e-3, 0, 0), 1e-6));
  EXPECT_TRUE(passes(sheet, Vec3(3e-3, 0, 11e-3), Vec3(-2e-3, 0, 11e-3), 1.1e-3));
  EXPECT_FALSE(passes(sheet, Vec3(3e-3, 0, 11e-3), Vec3(-2e-3, 0, 11e-3), 0.8e-3));
  EXPECT_FALSE(passes(sheet, Vec3(3e-3, 0, 0), Vec3(0.5e-3, 0, 0), 0.2e-3));
  EXPECT_LT(reached(sheet, Vec3(3e-3, 0, 0), Vec3(-2e-3, 0, 0)).distance, -2e-3);
}

}  // namespace
}  // namespace palpate
