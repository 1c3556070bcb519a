// Many points at once: the same by every instruction set, and as a single point.
#include <cmath>

#include "lattice_test.hpp"
#include "palpate/lattice/lattice_batch.hpp"

namespace palpate {
namespace {

std::vector<Vec3f> points_about(const Grid& grid, std::size_t n) {
  std::mt19937_64 random(n);
  std::vector<Vec3f> points;
  for (std::size_t i = 0; i < n; ++i)
    points.push_back(test::random_in(grid.box().grown(i % 4 == 0 ? 1 : 0), random).cast<float>());
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
  if (n > 20) points[3] = {nan, 0, 0}, points[11] = {inf, 0, nan}, points[17] = {-1e30f, 0, 0};
  return points;
}

struct Answer {
  explicit Answer(std::size_t n) : distance(n), gradient(n), closest(n) {}
  std::vector<float> distance;
  std::vector<Vec3f> gradient, closest;
};

Answer ask(const Lattice& lattice, const std::vector<Vec3f>& points, Simd simd,
           Interpolation how = Interpolation::trilinear) {
  Answer a(points.size());
  lattice.sample(points, {a.distance, a.gradient, a.closest}, how, simd);
  return a;
}

bool same(float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); }

TEST(LatticeBatch, TheSameBitsByEveryInstructionSet) {
  const LatticeSamples s = test::sampled(test::torus(1, 0.4, 60, 30), 12, 0.1);
  const auto check = [&](const Lattice& lattice, Interpolation how) {
    for (const std::size_t n : {0, 1, 7, 8, 9, 15, 16, 17, 127, 128, 129, 2048, 2049, 5000}) {
      const std::vector<Vec3f> points = points_about(s.grid, n);
      const Answer portable = ask(lattice, points, Simd::portable, how);
      for (const Simd simd : {Simd::avx2, Simd::avx512}) {
        if (simd > best_simd()) continue;
        const Answer other = ask(lattice, points, simd, how);
        for (std::size_t i = 0; i < n; ++i) {
          EXPECT_TRUE(same(portable.distance[i], other.distance[i])) << name(simd) << i;
          for (int k = 0; k < 3; ++k) {
            EXPECT_TRUE(same(portable.gradient[i][k], other.gradient[i][k])) << name(simd) << i;
            EXPECT_TRUE(same(portable.closest[i][k], other.closest[i][k])) << name(simd) << i;
          }
        }
      }
    }
  };
  check(Lattice(s), Interpolation::trilinear);
  check(Lattice(s, Lattice::Storage::float16), Interpolation::trilinear);
  check(Lattice(s), Interpolation::hermite);
}

TEST(LatticeBatch, AnswersAsASinglePoint) {
  const LatticeSamples s = test::sampled(test::torus(1, 0.4, 60, 30), 12, 0.1);
  const Lattice lattice(s);
  const std::vector<Vec3f> points = points_about(s.grid, 5000);
  const Answer a = ask(lattice, points, best_simd());
  const double e = 1e-3 * s.grid.h;
  int cells = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 p = points[i].cast<double>();
    const double d = lattice.distance(p);
    if (!std::isfinite(d)) {
      EXPECT_EQ(std::isnan(a.distance[i]), std::isnan(d));
      continue;
    }
    ASSERT_NEAR(a.distance[i], d, 1e-5 * s.grid.h + 1e-6 * std::abs(d));
    const auto closest = lattice.closest(p);
    ASSERT_EQ(closest.has_value(), !std::isnan(a.closest[i].x()));
    if (closest) {
      ASSERT_NEAR((*closest - a.closest[i].cast<double>()).norm(), 0, 1e-6);
    }
    if (!s.grid.box().grown(-2 * e).contains(p)) continue;
    for (int k = 0; k < 3; ++k) {  // the derivative, where the difference stays in the cell
      const double x = (p[k] - s.grid.origin[k]) / s.grid.h, t = x - std::floor(x);
      if (t < 0.01 || t > 0.99) continue;
      ++cells;
      const double slope =
          (lattice.distance(p + e * Vec3::Unit(k)) - lattice.distance(p - e * Vec3::Unit(k))) / (2 * e);
      ASSERT_NEAR(a.gradient[i][k], slope, 1e-4);
    }
  }
  EXPECT_GT(cells, 5000);
}

TEST(LatticeBatch, Float16IsOffByAtMostOneInTwoThousand) {
  const LatticeSamples s = test::sampled(test::torus(1, 0.4, 60, 30), 12, 0.1);
  const Lattice half(s, Lattice::Storage::float16);
  std::vector<Vec3f> points;
  for (int i = 0; i < s.grid.n[0]; ++i)
    for (int j = 0; j < s.grid.n[1]; ++j)
      for (int k = 0; k < s.grid.n[2]; ++k) points.push_back(s.grid.point(i, j, k).cast<float>());
  const Answer a = ask(half, points, best_simd());
  for (std::size_t i = 0; i < points.size(); ++i)  // float32 points are off the grid by 1e-7
    ASSERT_NEAR(a.distance[i], s.distance[i], 5e-4 * std::abs(s.distance[i]) + 1e-6);
}

// Such grids are stored with room between their rows: every form of query finds its places.
TEST(LatticeBatch, LargeGridsAnswerAsThePlaneTheyHold) {
  LatticeSamples s;
  s.grid = {Vec3(-0.01, 0.02, 0.5), 1e-3, {37, 251, 256}};
  const Vec3 normal = Vec3(2, -1, 3).normalized(), middle = s.grid.box().center();
  for (int i = 0; i < s.grid.n[0]; ++i)
    for (int j = 0; j < s.grid.n[1]; ++j)
      for (int k = 0; k < s.grid.n[2]; ++k) {
        const Vec3 p = s.grid.point(i, j, k);
        s.distance.push_back(normal.dot(p - middle));
        s.closest.push_back(p - s.distance.back() * normal);
      }
  std::mt19937_64 random(1);
  std::vector<Vec3f> points;
  for (int i = 0; i < 1000; ++i) points.push_back(test::random_in(s.grid.box(), random).cast<float>());
  for (const auto storage : {Lattice::Storage::float32, Lattice::Storage::float16}) {
    const Lattice lattice(s, storage);
    for (const Simd simd : {Simd::portable, Simd::avx2, Simd::avx512})
      for (const Interpolation how : {Interpolation::trilinear, Interpolation::hermite}) {
        if (simd > best_simd()) continue;
        const Answer a = ask(lattice, points, simd, how);
        for (std::size_t i = 0; i < points.size(); ++i) {
          const Vec3 p = points[i].cast<double>();
          const double d = normal.dot(p - middle),
                       allowed = storage == Lattice::Storage::float16 ? 1e-3 * std::abs(d) + 2e-6 : 1e-6;
          ASSERT_NEAR(a.distance[i], d, allowed) << name(simd) << i;
          ASSERT_NEAR(lattice.distance(p), d, 1e-7);
          ASSERT_NEAR((lattice.sample(p).gradient - normal).norm(), 0, 1e-5);
          if (s.grid.box().grown(-s.grid.h).contains(p)) {
            ASSERT_NEAR(lattice.smooth(p).distance, d, 1e-7);
          }
          if (s.grid.box().contains(p - d * normal)) {
            ASSERT_NEAR((a.closest[i].cast<double>() - (p - d * normal)).norm(), 0, 2e-6);
          }
        }
      }
  }
}

TEST(Half, RoundsToNearest) {
  for (std::uint32_t h = 0; h < 0x7c00u; ++h) {  // all finite ones, and what lies between
    const float x = from_half(static_cast<std::uint16_t>(h)),
                y = from_half(static_cast<std::uint16_t>(h + 1));
    ASSERT_EQ(to_half(x), h);
    ASSERT_EQ(to_half(-x), h | 0x8000u);
    if (h + 1 == 0x7c00u) break;
    ASSERT_EQ(to_half(x + 0.49f * (y - x)), h);
    ASSERT_EQ(to_half(x + 0.51f * (y - x)), h + 1);
    ASSERT_EQ(to_half(x + 0.5f * (y - x)), h + (h & 1u));
  }
  EXPECT_EQ(to_half(1e6f), 0x7c00);
  EXPECT_EQ(to_half(1.0f), 0x3c00);
  EXPECT_TRUE(std::isnan(from_half(to_half(std::nanf("")))));
}

}  // namespace
}  // namespace palpate
