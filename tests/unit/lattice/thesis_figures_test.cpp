// Figures 5.6 and 5.11 of the thesis as numbers.
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/geometry/shapes.hpp"
#include "palpate/lattice/lattice.hpp"

namespace palpate {
namespace {

// Fig. 5.6: the solid angles of grid points, over 4 pi, gather at 0 (outside) and 1 (inside), and decide as
// the distance's sign does. On a clean surface there are no outliers.
TEST(ThesisFigures, SolidAnglesOfGridPointsAreZeroOrOne) {
  const TriangleMesh surface = make_kidney(600);
  const LatticeSamples samples =
      sample_lattice(SignedDistanceField(surface), make_grid(bounding_box(surface.vertices), 8));
  ASSERT_EQ(samples.sign, SignMethod::pseudonormal);
  const WindingNumber fast(surface);
  const Grid& g = samples.grid;
  std::size_t inside = 0, number = 0;
  for (int i = 0; i < g.n[0]; ++i)
    for (int j = 0; j < g.n[1]; ++j)
      for (int k = 0; k < g.n[2]; ++k, ++number) {
        const double d = samples.distance[number];
        if (std::abs(d) < 1e-6 * g.h) continue;  // on the surface: 1/2
        const Vec3 p = g.point(i, j, k);
        EXPECT_NEAR(winding_number(surface, p), d < 0 ? 1.0 : 0.0, 1e-9);
        EXPECT_NEAR(fast.at(p), d < 0 ? 1.0 : 0.0, 0.05);
        inside += d < 0;
      }
  EXPECT_GT(inside, number / 4);
  EXPECT_LT(inside, number);
}

// The largest |interpolated - exact| along a ray through a torus (along x, off its axis), m.
double error_on_ray(const SignedDistanceField& field, const Grid& grid) {
  const Lattice lattice(sample_lattice(field, grid));
  double largest = 0;
  for (int i = 0; i <= 1000; ++i) {
    const Vec3 p(-0.08 + 1.6e-4 * i, 0.004, 0.013);
    largest = std::max(largest, std::abs(lattice.distance(p) - field.at(p).distance));
  }
  return largest;
}

// Fig. 5.11: trilinear distances on a ray through a torus come closer to the exact ones with every
// subdivision.
TEST(ThesisFigures, InterpolationErrorThroughATorusFallsWithSubdivisions) {
  const TriangleMesh torus = make_torus(0.06, 0.02, 64, 32);
  const SignedDistanceField field(torus);
  double last = 1;
  for (const int subdivisions : {2, 5, 10, 20}) {
    const Grid grid = make_grid(bounding_box(torus.vertices), subdivisions);
    const double error = error_on_ray(field, grid);
    EXPECT_LT(error, 0.5 * last) << subdivisions;
    EXPECT_LT(error, 0.25 * grid.h) << subdivisions;
    last = error;
  }
}

}  // namespace
}  // namespace palpate
