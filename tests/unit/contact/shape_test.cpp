#include "palpate/contact/shape.hpp"

#include <gtest/gtest.h>

#include <random>

#include "palpate/contact/clusters.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/geometry/signed_distance.hpp"

namespace palpate {
namespace {

const std::vector<Shape> primitives{Sphere{0.03}, Capsule{0.01, 0.04}, Cuboid{Vec3(0.01, 0.02, 0.03)},
                                    HalfSpace{}};

TEST(Shape, NormalIsTheGradientOfTheDistance) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-0.08, 0.08);
  for (const Shape& shape : primitives)
    for (int i = 0; i < 200; ++i) {
      const Vec3 p(uniform(random), uniform(random), uniform(random));
      const Gap g = gap(shape, p);
      EXPECT_NEAR(g.normal.norm(), 1, 1e-12);
      EXPECT_EQ(g.distance, distance(shape, p));
      const double e = 1e-7;
      // One axis at a time; points within e of a medial plane are too rare to meet with this seed.
      for (int a = 0; a < 3; ++a)
        EXPECT_NEAR(
            (distance(shape, p + e * Vec3::Unit(a)) - distance(shape, p - e * Vec3::Unit(a))) / (2 * e),
            g.normal[a], 1e-5);
    }
}

TEST(Shape, PrimitivesAgreeWithTheirSurfaces) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-0.06, 0.06);
  for (const Shape& shape : {primitives[0], primitives[1], primitives[2]}) {
    const TriangleMesh surface = surface_of_primitive(shape);
    const SignedDistanceField field(surface);
    const double facet = 0.03 * 0.01;  // a 24 x 32 sphere's facets lie up to 0.7 % inside
    for (int i = 0; i < 200; ++i) {
      const Vec3 p(uniform(random), uniform(random), uniform(random));
      EXPECT_NEAR(field.at(p).distance, distance(shape, p), facet);
    }
  }
}

TEST(Clusters, FindExactlyTheNearNodes) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.1, 0.1);
  std::vector<Vec3> points(1000);
  for (Vec3& p : points) p = Vec3(uniform(random), uniform(random), uniform(random));
  std::vector<Index> nodes;
  for (Index i = 0; i < 1000; i += 2) nodes.push_back(i);
  const Clusters clusters(points, nodes, 16);
  for (Vec3& p : points)
    p += 0.01 * Vec3(uniform(random), uniform(random), uniform(random));  // they move after baking
  ClusterBounds bounds(clusters);
  bounds.update(clusters, points);
  for (const Shape& shape : primitives) {
    const PlacedShape placed(shape, {Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized())),
                                     Vec3(0.02, -0.03, 0.01)});
    std::vector<Index> found, expected;
    near_nodes(clusters, bounds, points, placed, 0.005, [&](Index n, double) { found.push_back(n); });
    for (const Index n : nodes)
      if (placed.distance(points[static_cast<std::size_t>(n)]) < 0.005) expected.push_back(n);
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, expected);
    EXPECT_FALSE(expected.empty());
  }
  EXPECT_EQ(Clusters(points, {}).size(), 0u);
}

// Nodes that go on as they went, off by up to what their softness allows: all that may be near are looked at,
// and few others.
TEST(Clusters, LookWhereNodesAreAbout) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto some = [&] { return Vec3(uniform(random), uniform(random), uniform(random)); };
  std::vector<Vec3> points(4000), changes(points.size()), others(points.size());
  std::vector<Index> nodes;
  std::vector<float> softness(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i] = 0.1 * some(), changes[i] = Vec3(0.03, 0, -0.02) + 0.002 * some();
    softness[i] = 0.5f + static_cast<float>(i % 4) / 4, nodes.push_back(static_cast<Index>(i));
  }
  for (Vec3& other : others) other = Vec3(0, 0.05, 0) + 0.012 * some();
  const Clusters clusters(points, nodes, 16, softness);
  ClusterBounds bounds(clusters), change_bounds(clusters), other_bounds(clusters);
  bounds.update(clusters, points);
  change_bounds.update(clusters, changes), other_bounds.update(clusters, others);
  const Shape ball = Sphere{0.02};
  const double drift = 0.003, reach = 0.002;
  for (const auto& [along, other] :
       {std::pair(-1.0, 0.0), {0.0, 0.0}, {0.7, 0.0}, {2.0, 0.0}, {0.7, 1.0}, {0.3, -2.0}}) {
    const PlacedShape placed(
        ball, {Eigen::Quaterniond::Identity(),
               Vec3(0.03, 0.01, -0.02) + along * Vec3(0.03, 0, -0.02) + other * Vec3(0, 0.05, 0)});
    std::vector<std::uint8_t> looked_at(points.size(), 0);
    look_near(clusters,
              {bounds, points, {{{change_bounds, changes, along}, {other_bounds, others, other}}}, drift},
              placed, reach, [&](Index node) { looked_at[static_cast<std::size_t>(node)] = 1; });
    std::size_t near = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3 about = points[i] + along * changes[i] + other * others[i];
      if (placed.distance(about) - static_cast<double>(softness[i]) * drift > reach) continue;
      ++near;
      ASSERT_TRUE(looked_at[i]) << along << ' ' << i;
    }
    EXPECT_GT(near, 30u);
    const auto looked = static_cast<std::size_t>(std::count(looked_at.begin(), looked_at.end(), 1));
    EXPECT_LT(looked, (other == 0 ? 5 : 12) * near);
  }
}

// A surface after one whose forces were no numbers has changed by none: nodes are looked at where they are.
TEST(Clusters, ChangesThatAreNoNumbersHideNoNode) {
  const std::vector<Vec3> points{Vec3(0.01, 0, 0), Vec3(0.02, 0, 0), Vec3(0.5, 0, 0)};
  const std::vector<Vec3> changes(points.size(), Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
  const Clusters clusters(points, {0, 1, 2}, 2);
  ClusterBounds bounds(clusters), change_bounds(clusters);
  bounds.update(clusters, points), change_bounds.update(clusters, changes);
  const Whereabouts::Shift none{change_bounds, changes, 0};
  const Shape ball = Sphere{0.02};
  std::vector<Index> looked_at;
  look_near(clusters, {bounds, points, {none, none}}, {ball, Pose{}}, 0.005,
            [&](Index node) { looked_at.push_back(node); });
  EXPECT_GE(std::count(looked_at.begin(), looked_at.end(), 0), 1);
  EXPECT_GE(std::count(looked_at.begin(), looked_at.end(), 1), 1);
}

}  // namespace
}  // namespace palpate
