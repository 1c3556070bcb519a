#include "palpate/contact/symmetric_half.hpp"

#include <gtest/gtest.h>

#include <random>

namespace palpate {
namespace {

// Against the whole matrix, while its rows come and change one by one, in any order.
TEST(SymmetricHalf, MultipliesAsTheWholeMatrix) {
  constexpr std::size_t most = 43, plane = 64;
  std::mt19937 random(11);
  std::uniform_real_distribution<float> share(-1, 1);
  SymmetricHalf half(most);
  std::vector<float> whole(most * 9 * plane);
  const auto element = [&](std::size_t i, std::size_t j, std::size_t a, std::size_t b) -> float& {
    return whole[i * 9 * plane + element_at(j, a, b)];
  };
  for (int round = 0; round < 400; ++round) {
    const std::size_t n = 1 + random() % most, i = random() % n;
    for (std::size_t j = 0; j < most; ++j)
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b)
          if (i != j || a <= b) element(i, j, a, b) = element(j, i, b, a) = share(random);
    half.set(i, &whole[i * 9 * plane], most);
    std::vector<float> f(3 * plane), u(3 * plane);
    for (std::size_t b = 0; b < 3; ++b)
      for (std::size_t j = 0; j < n; ++j) f[b * plane + j] = share(random), u[b * plane + j] = share(random);
    const std::vector<float> before = u;
    half.add_product(n, plane, f, u);
    for (std::size_t k = 0; k < n; ++k)
      for (std::size_t a = 0; a < 3; ++a) {
        double expected = static_cast<double>(before[a * plane + k]);
        for (std::size_t j = 0; j < n; ++j)
          for (std::size_t b = 0; b < 3; ++b)
            expected += static_cast<double>(element(k, j, a, b)) * static_cast<double>(f[b * plane + j]);
        ASSERT_NEAR(static_cast<double>(u[a * plane + k]), expected, 3e-5) << round << ' ' << n << ' ' << k;
      }
    std::vector<float> along(plane * plane), sums(plane), work(3 * plane);  // f for normals
    half.along_normals(n, f, plane, false, along.data(), sums, work);
    for (std::size_t k = 0; k < n; ++k) {
      double sum = 0;
      for (std::size_t j = 0; j < n; ++j) {
        double expected = 0;
        for (std::size_t a = 0; a < 3; ++a)
          for (std::size_t b = 0; b < 3; ++b)
            expected += static_cast<double>(f[a * plane + k] * element(k, j, a, b) * f[b * plane + j]);
        sum += std::abs(expected);
        if (j / 8 <= k / 8) {
          ASSERT_NEAR(static_cast<double>(along[k * plane + j]), expected, 3e-6) << n;
        }
      }
      ASSERT_NEAR(static_cast<double>(sums[k]), sum, 3e-5) << n << ' ' << k;
    }
  }
}

// Points in a cube that move each other as in a half-space, and softer to one side; rows change as they do in
// ticks.
TEST(SymmetricHalf, MultipliesRoughlyWithinWhatItIsAllowed) {
  constexpr std::size_t n = 210, plane = 224;
  std::mt19937 random(12);
  std::uniform_real_distribution<float> share(-1, 1);
  SymmetricHalf half(n);
  std::vector<Vec3> points(n);
  const auto anywhere = [&] {
    return Vec3(10 * Vec3::NullaryExpr([&] { return static_cast<double>(share(random)); }));
  };
  for (Vec3& p : points) p = anywhere();
  std::vector<float> whole(n * 9 * plane), f(3 * plane), work(6 * plane);
  const auto row_of = [&](std::size_t i) {
    for (std::size_t j = 0; j < n; ++j) {
      const Vec3 way = points[i] - points[j];
      const double r = way.norm(), soft = std::exp(0.002 * (points[i].x() + points[j].x()));
      const Mat3 c = i == j
                         ? Mat3(soft * Mat3::Identity())
                         : Mat3(soft * 0.4 / (1 + r) * (Mat3::Identity() + way * way.transpose() / (r * r)));
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b)
          whole[9 * i * plane + element_at(j, a, b)] = whole[9 * j * plane + element_at(i, b, a)] =
              static_cast<float>(c(static_cast<int>(a), static_cast<int>(b)));
    }
    half.set(i, &whole[9 * i * plane], n);
  };
  for (std::size_t i = 0; i < n; ++i) row_of(i);
  for (int round = 0; round < 20; ++round) {
    const std::size_t i = random() % n;
    points[i] = anywhere();
    row_of(i);
    for (std::size_t b = 0; b < 3; ++b)
      for (std::size_t j = 0; j < n; ++j) f[b * plane + j] = share(random);
    std::vector<float> exact(3 * plane), rough(3 * plane);
    half.add_product(n, plane, f, exact);
    float allowed = 1e-6f;  // the least it does with
    for (; !half.add_rough_product(n, plane, f, allowed, rough, work); allowed *= 1.01f)
      ASSERT_EQ(rough, std::vector<float>(3 * plane));
    double squared = 0, worst = 0;
    for (std::size_t b = 0; b < 3; ++b)
      for (std::size_t k = 0; k < n; ++k) {
        const double off = static_cast<double>(exact[b * plane + k] - rough[b * plane + k]);
        squared += off * off, worst = std::max(worst, std::abs(off));
      }
    EXPECT_LT(std::sqrt(squared / (3 * n)), 1.08 * static_cast<double>(allowed)) << round;
    EXPECT_LT(worst, 5 * static_cast<double>(allowed)) << round;
    EXPECT_GT(std::sqrt(squared / (3 * n)), 0.2 * static_cast<double>(allowed))
        << round;                                            // it says what it is
    EXPECT_LT(static_cast<double>(allowed), 1e-3) << round;  // of some units
  }
}

}  // namespace
}  // namespace palpate
