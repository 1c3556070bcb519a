#include "palpate/contact/projected_gradients.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "palpate/base/clones.hpp"
#include "palpate/contact/lanes.hpp"

namespace palpate {

namespace {

constexpr std::size_t ways = 16;  // sums are so many sums in turn, whatever the instruction set

float sum_of(const float* parts) noexcept {
  float sum = 0;
  for (std::size_t l = 0; l < ways; ++l) sum += parts[l];
  return sum;
}

}  // namespace

// Eight rows, four of them at a time: against the columns before the eight both ways, each number of A read
// once; among the eight one way.
PALPATE_CLONES void multiply_symmetric(const float* a, std::size_t n, std::size_t ld, const float* x,
                                       float* y) noexcept {
  const std::size_t end = (n + ways - 1) / ways * ways;
  std::fill_n(y, end, 0.0f);
  for (std::size_t first = 0; first < n; first += lanes) {
    Lanes sums[lanes];
    for (std::size_t l = 0; l < lanes; l += 4) {
      const auto row = [&](std::size_t i) { return a + std::min(first + l + i, n - 1) * ld; };
      const float *r0 = row(0), *r1 = row(1), *r2 = row(2), *r3 = row(3),
                  *of = x + first + l;  // zero beyond n
      const float x0 = of[0], x1 = of[1], x2 = of[2], x3 = of[3];
      Lanes s0 = {}, s1 = {}, s2 = {}, s3 = {};
      for (std::size_t k = 0; k < first; k += lanes) {
        const Lanes a0 = at(r0 + k), a1 = at(r1 + k), a2 = at(r2 + k), a3 = at(r3 + k), xk = at(x + k);
        at(y + k) += (a0 * x0 + a1 * x1) + (a2 * x2 + a3 * x3);
        s0 += a0 * xk, s1 += a1 * xk, s2 += a2 * xk, s3 += a3 * xk;
      }
      const Lanes own = at(x + first);
      sums[l] = s0 + at(r0 + first) * own, sums[l + 1] = s1 + at(r1 + first) * own;
      sums[l + 2] = s2 + at(r2 + first) * own, sums[l + 3] = s3 + at(r3 + first) * own;
    }
    add_totals(sums, at(y + first));
  }
  std::fill(y + n, y + end, 0.0f);
}

PALPATE_CLONES int minimise_over_bounds(const float* a, std::size_t n, std::size_t ld, float norm,
                                        const SparseInverse& inverse, std::span<const float> b,
                                        std::span<const float> lower, std::span<const float> within,
                                        std::span<float> x, const GradientWork& work, int most) noexcept {
  // Whole ways; what is beyond n stays zero.
  const std::size_t end = (n + ways - 1) / ways * ways;
  float* const __restrict g = work.gradient.data(), * const __restrict d = work.way.data();
  float* const __restrict ad = work.product.data(), * const __restrict y = x.data();
  const float* const __restrict low = lower.data(), * const __restrict near = within.data();
  float* const __restrict r = work.free.data(), * const __restrict z = work.downhill.data();
  const float step = 1.8f / norm;
  int products = 0;
  const auto gradient = [&] {
    multiply_symmetric(a, n, ld, y, g), ++products;
    for (std::size_t i = 0; i < n; ++i) g[i] += b[i];
  };
  // z: the way down on the free entries.
  const auto look_down = [&] {
    for (std::size_t i = 0; i < end; ++i) r[i] = y[i] > low[i] ? g[i] : 0.0f;
    inverse.apply(n, r, z);
    for (std::size_t i = 0; i < end; ++i) z[i] = y[i] > low[i] ? z[i] : 0.0f;
  };
  std::fill(y + n, y + end, 0.0f), std::fill(z + n, z + end, 0.0f);
  std::copy_n(b.data(), n, g), std::fill(g + n, g + end, 0.0f);
  if (std::any_of(y, y + n, [](float v) { return v != 0; })) gradient();
  look_down();
  std::copy_n(z, end, d);
  while (products < most) {
    float reduced[ways] = {}, chopped[ways] = {};
    std::int32_t wrong[ways] = {};
    for (std::size_t k = 0; k < end; k += ways)
      for (std::size_t l = 0; l < ways; ++l) {
        const std::size_t i = k + l;
        const float room = y[i] - low[i], phi = room > 0 ? g[i] : 0.0f;
        const float beta = room > 0 ? 0.0f : std::min(g[i], 0.0f);
        reduced[l] += phi * std::min(room / step, phi);
        chopped[l] += beta * beta;
        wrong[l] |= !(std::abs(phi + beta) <= near[i]);  // no number is wrong too
      }
    if (std::none_of(wrong, wrong + ways, [](std::int32_t w) { return w != 0; })) return products;
    const bool release = sum_of(chopped) > sum_of(reduced);
    if (release)
      for (std::size_t i = 0; i < end; ++i) d[i] = y[i] > low[i] ? 0.0f : std::min(g[i], 0.0f);
    multiply_symmetric(a, n, ld, d, ad), ++products;
    float slope[ways] = {}, curvature[ways] = {}, feasible[ways];
    std::fill_n(feasible, ways, std::numeric_limits<float>::infinity());
    for (std::size_t k = 0; k < end; k += ways)
      for (std::size_t l = 0; l < ways; ++l) {
        const std::size_t i = k + l;
        slope[l] += g[i] * d[i], curvature[l] += d[i] * ad[i];
        const float until = (y[i] - low[i]) / d[i];
        feasible[l] = d[i] > 0 ? std::min(feasible[l], until) : feasible[l];
      }
    const float bent = sum_of(curvature);
    if (!(bent > 0)) return -1;
    const float length = sum_of(slope) / bent, most_length = *std::min_element(feasible, feasible + ways);
    const bool blocked = !release && length > most_length;
    const float taken = blocked ? most_length : length;
    for (std::size_t i = 0; i < end; ++i) {
      y[i] = std::max(low[i], y[i] - taken * d[i]);
      g[i] -= taken * ad[i];
    }
    float back = 0;
    if (blocked) {
      for (std::size_t i = 0; i < end; ++i)
        y[i] = std::max(low[i], y[i] - (y[i] > low[i] ? step * g[i] : 0.0f));
      gradient();
    }
    look_down();
    if (!blocked && !release) {
      float turn[ways] = {};
      for (std::size_t k = 0; k < end; k += ways)
        for (std::size_t l = 0; l < ways; ++l) turn[l] += z[k + l] * ad[k + l];
      back = sum_of(turn) / bent;
    }
    for (std::size_t i = 0; i < end; ++i) d[i] = z[i] - back * d[i];
  }
  return -1;
}

}  // namespace palpate
