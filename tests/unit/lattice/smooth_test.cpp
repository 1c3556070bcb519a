#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "palpate/geometry/shapes.hpp"
#include "palpate/lattice/lattice.hpp"

namespace palpate {
namespace {

// Samples of a function on the unit cube; closest points do not matter here.
Lattice sampled(const std::function<double(const Vec3&)>& f) {
  LatticeSamples s;
  s.grid = make_grid({Vec3::Zero(), Vec3::Ones()}, 10);
  for (int i = 0; i < s.grid.n[0]; ++i)
    for (int j = 0; j < s.grid.n[1]; ++j)
      for (int k = 0; k < s.grid.n[2]; ++k) {
        s.distance.push_back(f(s.grid.point(i, j, k)));
        s.closest.push_back(Vec3::Zero());
      }
  return Lattice(s);
}

TEST(LatticeSmooth, GradientIsTheDerivativeOfTheDistanceEverywhere) {
  const TriangleMesh box = make_box({Vec3(0.3, 0.35, 0.3), Vec3(0.7, 0.6, 0.8)});  // edges and corners
  const SignedDistanceField field(box);
  const Lattice lattice(sample_lattice(field, make_grid({Vec3::Zero(), Vec3::Ones()}, 17)));
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0.05, 0.95);
  const double e = 1e-4;
  for (int n = 0; n < 3000; ++n) {
    const Vec3 p(uniform(random), uniform(random), uniform(random));
    const LatticeSample s = lattice.smooth(p);
    for (int a = 0; a < 3;
         ++a) {  // central differences straddle cells too: a jump of the gradient would show
      const double slope =
          (lattice.smooth(p + e * Vec3::Unit(a)).distance - lattice.smooth(p - e * Vec3::Unit(a)).distance) /
          (2 * e);
      EXPECT_NEAR(slope, s.gradient[a], 4e-3);
    }
    const LatticeSample next = lattice.smooth(p + 1e-7 * Vec3(1, 1, 1));
    EXPECT_LT((next.gradient - s.gradient).norm(), 1e-4);
    EXPECT_NEAR(s.distance, field.at(p).distance, 0.35 * lattice.grid().h);
  }
}

TEST(LatticeSmooth, PlanesAreExactAndParabolasOffByAConstant) {
  const Vec3 n = Vec3(1, -2, 0.5).normalized();
  const Lattice plane = sampled([&](const Vec3& p) { return n.dot(p) - 0.2; });
  const Lattice bowl = sampled([&](const Vec3& p) { return (p - Vec3(0.5, 0.5, 0.5)).squaredNorm(); });
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(0.1, 0.9);
  for (int i = 0; i < 500; ++i) {
    const Vec3 p(uniform(random), uniform(random), uniform(random));
    EXPECT_NEAR(plane.smooth(p).distance, n.dot(p) - 0.2, 1e-6);
    EXPECT_LT((plane.smooth(p).gradient - n).norm(), 1e-5);
    // h^2/8 times the sum of the second derivatives, 6: no waves, so convex stays convex.
    EXPECT_NEAR(bowl.smooth(p).distance, (p - Vec3(0.5, 0.5, 0.5)).squaredNorm() + 0.01 * 6 / 8, 1e-6);
    EXPECT_LT((bowl.smooth(p).gradient - 2 * (p - Vec3(0.5, 0.5, 0.5))).norm(), 1e-5);
  }
}

// By one grid point, so a bound: never above, and not far below, inside the grid and out of it.
TEST(LatticeSmooth, LowerBoundIsOneAndNotALooseOne) {
  const Lattice lattice(sample_lattice(SignedDistanceField(make_torus(0.3, 0.12, 60, 30)),
                                       make_grid({Vec3(-0.45, -0.45, -0.15), Vec3(0.45, 0.45, 0.15)}, 9)));
  const double h = lattice.grid().h;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-0.8, 0.8);
  for (int i = 0; i < 50000; ++i) {
    const Vec3 p(uniform(random), uniform(random), uniform(random));
    const double d = lattice.smooth(p).distance, bound = lattice.lower_bound(p);
    ASSERT_LE(bound, d) << p.transpose();
    ASSERT_GE(bound, d - 2.61 * h) << p.transpose();
  }
  EXPECT_FALSE(lattice.lower_bound(Vec3(std::nan(""), 0, 0)) > 0);  // may be anywhere
  EXPECT_GT(lattice.lower_bound(Vec3(1e30, 0, 0)), 1e29);
}

TEST(LatticeSmooth, OutsideAndNoNumbersDoNoHarm) {
  const Lattice lattice(sample_lattice(SignedDistanceField(make_sphere(Vec3::Zero(), 0.3, 20, 40)),
                                       make_grid({Vec3::Constant(-0.4), Vec3::Constant(0.4)}, 12)));
  for (const Vec3& p : {Vec3(2, 0, 0), Vec3(0, -3, 1), Vec3(1e30, 0, 0)}) {
    const LatticeSample s = lattice.smooth(p);
    EXPECT_GT(s.distance, 0);
    EXPECT_TRUE(s.gradient.allFinite());
    EXPECT_LE(s.distance, p.norm() - 0.29);
  }
  lattice.smooth(Vec3(std::nan(""), 0, INFINITY));
}

}  // namespace
}  // namespace palpate
