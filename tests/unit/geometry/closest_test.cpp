#include <gtest/gtest.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <random>

#include "meshes.hpp"
#include "palpate/geometry/bvh.hpp"

namespace palpate {
namespace {

ClosestPoint brute_force(const TriangleMesh& mesh, const Vec3& p) {
  ClosestPoint best;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    const auto corner = [&](std::size_t k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
    ClosestPoint c = closest_on_triangle(p, corner(0), corner(1), corner(2));
    if (c.distance_squared < best.distance_squared) c.triangle = static_cast<Index>(i), best = c;
  }
  return best;
}

// The same by another road: least squares for the barycentric coordinates in long double, and all three
// edges.
long double oracle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  using V = Eigen::Matrix<long double, 3, 1>;
  const V P = p.cast<long double>(), A = a.cast<long double>(), B = b.cast<long double>(),
          C = c.cast<long double>();
  const auto on_segment = [&](const V& u, const V& v) {
    const V e = v - u;
    const long double l2 = e.squaredNorm();
    const long double t = l2 > 0 ? std::clamp<long double>((P - u).dot(e) / l2, 0, 1) : 0;
    return (P - u - t * e).norm();
  };
  long double best = std::min({on_segment(A, B), on_segment(B, C), on_segment(C, A)});
  Eigen::Matrix<long double, 3, 2> m;
  m << B - A, C - A;
  const Eigen::ColPivHouseholderQR<Eigen::Matrix<long double, 3, 2>> qr(m);
  const Eigen::Matrix<long double, 2, 1> x = qr.solve(P - A);
  if (qr.rank() == 2 && x.minCoeff() >= 0 && x.sum() <= 1) best = std::min(best, (P - A - m * x).norm());
  return best;
}

TEST(ClosestOnTriangle, EqualsTheOracleOnNeedlesCapsAndPoints) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto point = [&] { return Vec3(u(random), u(random), u(random)); };
  for (int i = 0; i < 20000; ++i) {
    Vec3 a = point(), b = point(), c = point(), p = 3 * point();
    const double thin = std::pow(10.0, -1 - (i / 8) % 17);
    switch (i % 8) {
      case 1:
        c = a + thin * point();
        break;  // needle
      case 2:
        c = 0.3 * a + 0.7 * b + thin * point();
        break;  // cap
      case 3:
        c = a;
        break;  // segment
      case 4:
        b = c = a;
        break;  // point
      case 5:
        p = 0.2 * a + 0.5 * b + 0.3 * c;
        break;  // on it
      case 6:
        p = a + thin * point();
        break;  // at a corner
      case 7:
        b = a + thin * (b - a), c = a + thin * (c - a);
        break;  // small
    }
    const ClosestPoint q = closest_on_triangle(p, a, b, c);
    ASSERT_TRUE(q.point.allFinite());
    ASSERT_NEAR(std::sqrt(q.distance_squared), static_cast<double>(oracle(p, a, b, c)), 3e-8) << i;
    ASSERT_NEAR(static_cast<double>(oracle(q.point, a, b, c)), 0, 3e-8) << i;
  }
}

TEST(Bvh, EqualsBruteForceToTheBit) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> u(-1, 1);
  TriangleMesh needles = test::soup(500, 3);  // each thinner than the one before
  for (std::size_t i = 0; i < 500; ++i) {
    Vec3* v = &needles.vertices[3 * i];
    v[2] = v[0] + std::pow(0.9, static_cast<double>(i)) * (v[2] - v[0]);
  }
  for (TriangleMesh mesh : {test::soup(2000, 1), test::torus(1, 0.4, 40, 20), test::soup(3, 2), needles}) {
    // Duplicates, degenerates and a second copy: ties all over.
    const std::size_t n = mesh.triangles.size();
    for (std::size_t i = 0; i < n; i += 3) mesh.triangles.push_back(mesh.triangles[i]);
    mesh.triangles.push_back({0, 0, 1});
    mesh.triangles.push_back({2, 2, 2});
    for (const Simd simd : {Simd::portable, best_simd()}) {
      const Bvh bvh(mesh, simd);
      Index hint = -1;
      for (int i = 0; i < 800; ++i) {
        Vec3 p = 2 * Vec3(u(random), u(random), u(random));
        if (i % 10 == 0) p = mesh.vertices[static_cast<std::size_t>(i) % mesh.vertices.size()];
        if (i % 10 == 1) p *= 1e6;
        const ClosestPoint expected = brute_force(mesh, p), found = bvh.closest(p);
        ASSERT_EQ(found.distance_squared, expected.distance_squared);
        ASSERT_EQ(found.triangle, expected.triangle);
        ASSERT_EQ(found.point, expected.point);
        const ClosestPoint hinted = bvh.closest(p, std::numeric_limits<double>::infinity(), hint);
        ASSERT_EQ(hinted.triangle, expected.triangle);
        ASSERT_EQ(hinted.point, expected.point);
        hint = found.triangle;
        EXPECT_EQ(bvh.closest(p, expected.distance_squared).triangle, -1);
        EXPECT_EQ(bvh.closest(p, expected.distance_squared * (1 + 1e-9) + 1e-300).triangle,
                  expected.triangle);
      }
    }
  }
}

TEST(Bvh, AThousandTrianglesAtOnePlaceAndNumbersThatAreNone) {
  TriangleMesh mesh{{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}, {}};
  mesh.triangles.assign(1000, Triangle{0, 1, 2});
  const Bvh bvh(mesh);
  EXPECT_EQ(bvh.closest(Vec3(0.2, 0.2, 3)).triangle, 0);
  EXPECT_EQ(bvh.closest(Vec3(0.2, 0.2, 3)).distance_squared, 9);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(bvh.closest(Vec3(nan, 0, 0)).triangle, -1);
  EXPECT_EQ(Bvh(TriangleMesh{}).closest(Vec3::Zero()).triangle, -1);
  // Where float32 overflows.
  for (const Simd simd : {Simd::portable, best_simd()})
    for (const double x : {1e20, 1e40, 1e100}) {
      EXPECT_EQ(Bvh(test::torus(1, 0.4, 40, 20), simd).closest(Vec3(x, 0, 0)).distance_squared, x * x);
      TriangleMesh huge = test::torus(1, 0.4, 40, 20);
      for (Vec3& v : huge.vertices) v *= x * 1e-40;
      EXPECT_NEAR(Bvh(huge, simd).closest(Vec3(2 * x * 1e-40, 0, 0)).distance_squared / (x * x * 1e-80), 0.36,
                  1e-12);
    }
}

// Doubling distances would make a tree by area as deep as it has triangles.
TEST(Bvh, ExponentiallySpacedTriangles) {
  TriangleMesh mesh;
  for (int i = 0; i < 400; ++i) {
    const double x = std::pow(2.0, i - 200);
    const auto n = static_cast<Index>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {Vec3(x, 0, 0), Vec3(x, x, 0), Vec3(x, 0, x)});
    mesh.triangles.push_back({n, n + 1, n + 2});
  }
  const Bvh bvh(mesh);
  for (int i = 0; i < 400; ++i) {
    const double x = std::pow(2.0, i - 200);
    EXPECT_EQ(bvh.closest(Vec3(1.1 * x, 0.1 * x, 0.1 * x)).triangle, i);
  }
}

}  // namespace
}  // namespace palpate
