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
  std::vector<float> whole(most * 9 * plane);  // of each block row: 3 rows of 3 planes
  const auto element = [&](std::size_t i, std::size_t j, std::size_t a, std::size_t b) -> float& {
    return whole[(i * 9 + 3 * a + b) * plane + j];
  };
  for (int round = 0; round < 400; ++round) {
    const std::size_t n = 1 + random() % most, i = random() % n;
    for (std::size_t j = 0; j < most; ++j)
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b)
          if (i != j || a <= b) element(i, j, a, b) = element(j, i, b, a) = share(random);
    half.set(i, &whole[i * 9 * plane], plane, most);
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
  }
}

}  // namespace
}  // namespace palpate
