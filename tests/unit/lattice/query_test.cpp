// What is asked online.
#include "lattice_test.hpp"
#include "palpate/geometry/shapes.hpp"

namespace palpate {
namespace {

using test::box_of, test::sampled;

TEST(LatticeQuery, AtGridPointsItIsTheSample) {
  const LatticeSamples s = sampled(test::torus(1, 0.4, 40, 20), 9, 0.1);
  const Lattice lattice(s);
  std::size_t number = 0;
  for (int i = 0; i < s.grid.n[0]; ++i)
    for (int j = 0; j < s.grid.n[1]; ++j)
      for (int k = 0; k < s.grid.n[2]; ++k, ++number) {
        const Vec3 p = s.grid.point(i, j, k);
        ASSERT_NEAR(lattice.distance(p), s.distance[number], 1e-6);
        ASSERT_NEAR((p - s.distance[number] * lattice.sample(p).gradient - s.closest[number]).norm(), 0,
                    1e-6);
      }
}

TEST(LatticeQuery, TrilinearInEachCell) {
  LatticeSamples s;
  s.grid = {Vec3(0.1, 0.2, 0.3), 0.5, {4, 3, 5}};
  const auto f = [](const Vec3& p) {
    return 1 + 2 * p.x() - p.y() + 3 * p.z() + p.x() * p.y() - 2 * p.y() * p.z() + p.x() * p.y() * p.z();
  };
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 5; ++k) {
        s.distance.push_back(f(s.grid.point(i, j, k)));
        s.closest.push_back(Vec3::Zero());
      }
  const Lattice lattice(s);
  std::mt19937_64 random(1);
  for (int i = 0; i < 200; ++i) {
    const Vec3 p = test::random_in(s.grid.box(), random);
    EXPECT_NEAR(lattice.distance(p), f(p), 2e-6);
  }
}

TEST(LatticeQuery, OutsideTheBoxContinuousAndNeverTooFar) {
  const TriangleMesh mesh = test::torus(1, 0.4, 40, 20);
  const SignedDistanceField field(mesh);
  const Lattice lattice(sampled(mesh, 6));
  const Box box = lattice.grid().box();
  const double h = lattice.grid().h;
  std::mt19937_64 random(2);
  for (int i = 0; i < 20000; ++i) {
    const Vec3 p = test::random_in(box.grown(3), random);
    const Vec3 nearest = p.cwiseMax(box.min).cwiseMin(box.max);
    const double s = (p - nearest).norm(), d = lattice.distance(p), exact = field.at(p).distance;
    if (s > std::sqrt(0.5) * h) {
      ASSERT_LE(d, exact + 1e-6);
    }
    if (s > 0) {
      ASSERT_LE(d, exact + std::sqrt(0.5) * h);
      ASSERT_GE(d, s * (1 - 1e-12));
      ASSERT_GE(d, std::sqrt(0.5) * exact - h) << "useless";
    }
    // Continuity, across the box's faces too: a step of eps changes it by no more than 3 eps.
    const Vec3 q = nearest + 1e-7 * Vec3(1, -2, 0.5), r = nearest - 1e-7 * Vec3(1, -2, 0.5);
    ASSERT_NEAR(lattice.distance(q), lattice.distance(r), 2e-6);
    ASSERT_NEAR(lattice.sample(p).distance, d, 0);
    ASSERT_NEAR(lattice.sample(p).gradient.norm(), 1, 1e-6);
  }
  // Far away the gradient points away from the box.
  EXPECT_GT(lattice.sample(Vec3(100, 20, 3)).gradient.dot(Vec3(100, 20, 3).normalized()), 0.999);
}

TEST(LatticeQuery, GradientIsTheSurfacesNormalAndContinuous) {
  const double major = 1, minor = 0.4;
  const TriangleMesh mesh = test::torus(major, minor, 200, 100);
  const Lattice lattice(sampled(mesh, 20, 0.1));
  std::mt19937_64 random(3);
  for (int i = 0; i < 5000; ++i) {
    const Vec3 p = test::random_in(lattice.grid().box(), random);
    const Vec3 ring = major * Vec3(p.x(), p.y(), 0).normalized();
    if (std::abs((p - ring).norm() - minor) > 0.1) continue;
    const LatticeSample s = lattice.sample(p);
    EXPECT_GT(s.gradient.dot((p - ring).normalized()), std::cos(0.04));
    EXPECT_LT((lattice.sample(p + Vec3::Constant(1e-6)).gradient - s.gradient).norm(), 1e-4);
  }
}

// A cube on its own grid: many grid points lie exactly on the surface.
TEST(LatticeQuery, GradientOnGridPointsOfTheSurface) {
  const TriangleMesh mesh = test::cube(Vec3::Zero(), 1);
  const LatticeSamples tight = sampled(mesh, 8);
  ASSERT_EQ(tight.touching.size(), 9u * 9 * 9 - 7 * 7 * 7);
  EXPECT_EQ(tight.touching_normal.size(), tight.touching.size());
  for (const double margin : {0.0, 0.25, 0.3}) {
    const Lattice lattice(sampled(mesh, 8, margin));
    for (double y = -0.4; y <= 0.4; y += 0.1) {
      EXPECT_NEAR((lattice.sample(Vec3(1, y, 0.2)).gradient - Vec3(1, 0, 0)).norm(), 0, 1e-6) << margin;
      EXPECT_NEAR((lattice.sample(Vec3(y, -0.1, -1)).gradient - Vec3(0, 0, -1)).norm(), 0, 1e-6) << margin;
      EXPECT_NEAR(lattice.distance(Vec3(1, y, 0.2)), 0, 1e-6);
    }
    const Vec3 corner = lattice.sample(Vec3(1, 1, 1)).gradient;
    EXPECT_GT(corner.dot(Vec3::Ones().normalized()), margin == 0.3 ? 0.8 : 0.9999) << margin;
    // Text knows no normals: the same by differences.
    LatticeSamples text = sampled(mesh, 8, margin);
    text.touching.clear();
    const Lattice other(text);
    EXPECT_NEAR((other.sample(Vec3(1, 0.3, 0.2)).gradient - Vec3(1, 0, 0)).norm(), 0, 1e-6) << margin;
    EXPECT_GT(other.sample(Vec3(1, 1, 1)).gradient.dot(Vec3::Ones().normalized()), 0.8) << margin;
  }
}

// Also across the medial axis, at sharp edges and between the sides of a plate thinner than a cell: nearer to
// the surface than the lattice's own distances are exact.
TEST(LatticeQuery, ClosestIsOnTheSurfaceOrNothing) {
  std::vector<std::pair<TriangleMesh, double>> meshes{{test::torus(1, 0.4, 60, 30), 0.7},
                                                      {test::cube(Vec3::Zero(), 1), 0.7},
                                                      {make_kidney(600), 0.7},
                                                      {make_box({Vec3::Zero(), Vec3(1, 0.7, 0.03)}, 4), 0}};
  if (std::filesystem::exists(test::inventor / "bishop.iv"))
    meshes.emplace_back(read_surface(test::inventor / "bishop.iv").mesh, 0.5);
  for (const auto& [mesh, share] : meshes) {
    const SignedDistanceField field(mesh);
    const Box box = box_of(mesh);
    const LatticeSamples s = sample_lattice(
        field, make_grid_spaced(box, box.size().maxCoeff() / 30, 0.1 * box.size().maxCoeff()), 1);
    const Lattice lattice(s);
    const double error = estimate_error(field, s, 20000).max;
    std::mt19937_64 random(5);
    int near = 0, found = 0;
    for (int i = 0; i < 40000; ++i) {
      const Vec3 p = test::random_in(s.grid.box(), random);
      const auto c = lattice.closest(p);
      if (c) {
        ASSERT_LE(std::abs(field.at(*c).distance), 1.1 * error)  // which is sampled, too
            << i << ", h " << s.grid.h;
      }
      if (std::abs(field.at(p).distance) < 0.5 * s.grid.h) ++near, found += c.has_value();
    }
    EXPECT_GE(found, share * near) << found << " of " << near;
  }
  // In the middle of the cube, and in the torus' ring: nothing.
  EXPECT_FALSE(Lattice(sampled(test::cube(Vec3::Zero(), 1), 9)).closest(Vec3(0.01, 0.02, 0)));
  EXPECT_FALSE(Lattice(sampled(test::torus(1, 0.4, 60, 30), 9)).closest(Vec3(0.01, 0.02, 0.01)));
}

TEST(LatticeQuery, AnyNumberIsAnswered) {
  const Lattice lattice(sampled(test::cube(Vec3::Zero(), 1), 4));
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(std::isnan(lattice.distance(Vec3(nan, 0, 0))));
  EXPECT_TRUE(std::isnan(lattice.sample(Vec3(0, nan, nan)).distance));
  EXPECT_FALSE(lattice.closest(Vec3(0, 0, nan)));
  EXPECT_EQ(lattice.distance(Vec3(inf, 0, 0)), inf);
  EXPECT_EQ(lattice.distance(Vec3(0, -inf, inf)), inf);
  EXPECT_GE(lattice.distance(Vec3(1e300, 0, 0)), 1e300);
  EXPECT_NEAR(lattice.distance(Vec3(1e9, 0, 0)), 1e9, 2);
  for (const Vec3& p : {Vec3(nan, 0, 0), Vec3(inf, 0, 0), Vec3(-inf, 1e300, nan)})
    EXPECT_NEAR(lattice.sample(p).gradient.norm(), 1, 1e-6);
}

TEST(LatticeQuery, SpansAnswerAsSinglePointsDo) {
  const Lattice lattice(sampled(test::torus(1, 0.4, 20, 10), 6));
  std::mt19937_64 random(7);
  std::vector<Vec3> points;
  for (int i = 0; i < 100; ++i) points.push_back(test::random_in(lattice.grid().box().grown(0.5), random));
  std::vector<double> distances(points.size());
  std::vector<LatticeSample> samples(points.size());
  lattice.distance(points, distances);
  lattice.sample(points, samples);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(distances[i], lattice.distance(points[i]));
    EXPECT_EQ(samples[i].gradient, lattice.sample(points[i]).gradient);
  }
}

}  // namespace
}  // namespace palpate
