#include <cmath>

#include "lattice_test.hpp"

namespace palpate {
namespace {

struct Rms {
  double trilinear = 0, hermite = 0;
};

// Near the surface, against `exact`.
template <class Exact>
Rms compare(const Lattice& lattice, double near, const Exact& exact) {
  std::mt19937_64 random(1);
  Rms sum;
  int n = 0;
  while (n < 20000) {
    const Vec3 p = test::random_in(lattice.grid().box(), random);
    const double d = exact(p);
    if (std::abs(d) > near) continue;
    ++n;
    sum.trilinear += std::pow(lattice.distance(p) - d, 2);
    sum.hermite += std::pow(lattice.hermite(p).distance - d, 2);
  }
  return {std::sqrt(sum.trilinear / n), std::sqrt(sum.hermite / n)};
}

constexpr double major = 0.6, minor = 0.25;
Vec3 on_ring(const Vec3& p) { return major * Vec3(p.x(), p.y(), 0).normalized(); }

TEST(LatticeHermite, OfFourthOrderOnASmoothTorus) {
  const auto at = [](int n) {
    LatticeSamples s;
    s.grid = {Vec3::Constant(-1), 2.0 / (n - 1), {n, n, n}};
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        for (int k = 0; k < n; ++k) {
          const Vec3 p = s.grid.point(i, j, k) + Vec3(1e-12, 0, 0), ring = on_ring(p);
          s.distance.push_back((p - ring).norm() - minor);
          s.closest.push_back(ring + minor * (p - ring).normalized());
        }
    return compare(Lattice(s), 0.05, [](const Vec3& p) { return (p - on_ring(p)).norm() - minor; });
  };
  const Rms fine = at(64), coarse = at(32);
  RecordProperty("trilinear", std::to_string(1e6 * fine.trilinear));
  RecordProperty("hermite", std::to_string(1e6 * fine.hermite));
  EXPECT_LE(fine.hermite, 1e-6);
  EXPECT_GT(fine.trilinear, 1e-4);
  EXPECT_NEAR(std::log2(coarse.hermite / fine.hermite), 4, 0.6);
}

TEST(LatticeHermite, OnMeshesNoWorseThanTrilinear) {
  for (const TriangleMesh& mesh : {test::torus(1, 0.4, 60, 30), test::cube(Vec3(0.03, 0.02, 0.01), 1)}) {
    const SignedDistanceField field(mesh);
    const Lattice lattice(test::sampled(mesh, 15, 0.2));
    const Rms rms = compare(lattice, lattice.grid().h, [&](const Vec3& p) { return field.at(p).distance; });
    EXPECT_LE(rms.hermite, rms.trilinear);
  }
}

TEST(LatticeHermite, GradientIsTheDerivativeInEachCell) {
  const LatticeSamples s = test::sampled(test::torus(1, 0.4, 60, 30), 12, 0.1);
  const Lattice lattice(s);
  std::mt19937_64 random(3);
  const double e = 1e-2 * s.grid.h;
  for (int i = 0; i < 3000; ++i) {
    const Vec3 p = test::random_in(s.grid.box().grown(-2 * e), random);
    const LatticeSample h = lattice.hermite(p);
    for (int a = 0; a < 3; ++a) {
      const double x = (p[a] - s.grid.origin[a]) / s.grid.h, t = x - std::floor(x);
      if (t < 0.011 || t > 0.989) continue;
      const double slope = (lattice.hermite(p + e * Vec3::Unit(a)).distance -
                            lattice.hermite(p - e * Vec3::Unit(a)).distance) /
                           (2 * e);
      ASSERT_NEAR(h.gradient[a], slope, 2e-3);
    }
  }
  EXPECT_TRUE(std::isfinite(lattice.hermite(Vec3(1e30, 0, 0)).distance));
  lattice.hermite(Vec3(std::nan(""), 0, INFINITY));
}

}  // namespace
}  // namespace palpate
