#include "palpate/pad/fill.hpp"

#include <gtest/gtest.h>

#include "palpate/base/error.hpp"
#include "palpate/geometry/shapes.hpp"

namespace palpate {
namespace {

TriangleMesh ball(double radius) {
  return make_star_shaped(Vec3::Zero(), 12, [radius](const Vec3&) { return radius; });
}

std::vector<Vec3> filled(double spacing, bool grade, std::span<const Spaced> inner = {},
                         std::size_t limit = 100000) {
  const TriangleMesh mesh = ball(1);
  return fill(bounding_box(mesh.vertices), SignedDistanceField(mesh), spacing, inner, grade, limit);
}

double nearest(const std::vector<Vec3>& points, std::size_t i) {
  double least = 1e9;
  for (std::size_t j = 0; j < points.size(); ++j)
    if (j != i) least = std::min(least, (points[i] - points[j]).norm());
  return least;
}

TEST(Fill, UniformIsABodyCentredGrid) {
  const std::vector<Vec3> points = filled(0.1, false);
  // Two points a cube of side 0.2/sqrt(3), in the ball without its outermost 0.057.
  const double expected = 4.18879 * std::pow(0.943, 3) * 2 / std::pow(0.2 / std::sqrt(3.0), 3);
  EXPECT_NEAR(static_cast<double>(points.size()) / expected, 1, 0.05);
  for (std::size_t i = 0; i < points.size(); i += 7) EXPECT_NEAR(nearest(points, i), 0.1, 1e-9);
}

TEST(Fill, KeepsClearOfSurfacesAndCoarsensWithDepth) {
  const TriangleMesh stone = ball(0.3);
  const std::vector<Spaced> inner{{Bvh(stone), 0.06}};
  const Bvh outer(ball(1)), inside(stone);
  const std::vector<Vec3> points = filled(0.08, true, inner);
  std::vector<double> shallow, middle;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double to_outer = std::sqrt(outer.closest(points[i]).distance_squared);
    const double to_stone = std::sqrt(inside.closest(points[i]).distance_squared);
    EXPECT_LT(points[i].norm(), 1);
    EXPECT_GE(to_outer, 0.5 * 0.08);
    EXPECT_GE(to_stone, 0.5 * 0.06);
    if (to_outer < 0.1) shallow.push_back(nearest(points, i));
    if (std::abs(points[i].norm() - 0.65) < 0.05) middle.push_back(nearest(points, i));
  }
  ASSERT_FALSE(shallow.empty());
  ASSERT_FALSE(middle.empty());
  EXPECT_GT(*std::min_element(middle.begin(), middle.end()),
            1.5 * *std::min_element(shallow.begin(), shallow.end()));
  EXPECT_LT(points.size(), filled(0.08, false).size() / 2);
}

TEST(Fill, AbsurdSpacingIsAnErrorAndNoHang) {
  EXPECT_THROW(filled(0.1, false, {}, 100), Error);
  EXPECT_THROW(filled(1e-4, false, {}, 20000), Error);
  EXPECT_THROW(filled(1e-12, true), Error);
  EXPECT_TRUE(filled(50, true).empty());  // no room for any
}

}  // namespace
}  // namespace palpate
