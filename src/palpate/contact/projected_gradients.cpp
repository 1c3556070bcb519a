#include "palpate/contact/projected_gradients.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "palpate/contact/clones.hpp"

namespace palpate {

namespace {

constexpr std::size_t lanes = 16;  // sums are so many sums in turn, whatever the instruction set

float total(const float* parts) noexcept {
  float sum = 0;
  for (std::size_t l = 0; l < lanes; ++l) sum += parts[l];
  return sum;
}

}  // namespace

PALPATE_CLONES void add_weighted_rows(const float* a, std::size_t n, std::size_t ld, std::span<const float> x,
                                      float* y) noexcept {
  constexpr std::size_t most = 4;
  const float* row[most];
  float weight[most];
  std::size_t count = 0;
  for (std::size_t j = 0; j < x.size(); ++j) {
    if (x[j] == 0) continue;
    row[count] = a + j * ld, weight[count++] = x[j];
    if (count < most) continue;
    for (std::size_t i = 0; i < n; ++i)
      y[i] +=
          (weight[0] * row[0][i] + weight[1] * row[1][i]) + (weight[2] * row[2][i] + weight[3] * row[3][i]);
    count = 0;
  }
  for (std::size_t k = 0; k < count; ++k)
    for (std::size_t i = 0; i < n; ++i) y[i] += weight[k] * row[k][i];
}

PALPATE_CLONES int minimise_over_bounds(const float* a, std::size_t n, std::size_t ld, float norm,
                                        std::span<const float> b, std::span<const float> lower,
                                        std::span<const float> within, std::span<float> x,
                                        const GradientWork& work, int most) noexcept {
  // Whole lanes; what is beyond n stays zero.
  const std::size_t end = (n + lanes - 1) / lanes * lanes;
  float* const __restrict g = work.gradient.data(), * const __restrict d = work.way.data();
  float* const __restrict ad = work.product.data(), * const __restrict y = x.data();
  const float* const __restrict low = lower.data(), * const __restrict near = within.data();
  const float step = 1.8f / norm;
  int products = 0;
  const auto multiply = [&](std::span<const float> v, float* out) {
    add_weighted_rows(a, n, ld, v.first(n), out);
    ++products;
  };
  std::copy_n(b.data(), n, g);
  std::fill(g + n, g + end, 0.0f), std::fill(y + n, y + end, 0.0f);
  if (std::any_of(y, y + n, [](float v) { return v != 0; })) multiply(x, g);
  for (std::size_t i = 0; i < end; ++i) d[i] = y[i] > low[i] ? g[i] : 0.0f;
  while (products < most) {
    float reduced[lanes] = {}, chopped[lanes] = {};
    std::int32_t wrong[lanes] = {};
    for (std::size_t k = 0; k < end; k += lanes)
      for (std::size_t l = 0; l < lanes; ++l) {
        const std::size_t i = k + l;
        const float room = y[i] - low[i], phi = room > 0 ? g[i] : 0.0f;
        const float beta = room > 0 ? 0.0f : std::min(g[i], 0.0f);
        reduced[l] += phi * std::min(room / step, phi);
        chopped[l] += beta * beta;
        wrong[l] |= !(std::abs(phi + beta) <= near[i]);  // no number is wrong too
      }
    if (std::none_of(wrong, wrong + lanes, [](std::int32_t w) { return w != 0; })) return products;
    const bool release = total(chopped) > total(reduced);
    if (release)
      for (std::size_t i = 0; i < end; ++i) d[i] = y[i] > low[i] ? 0.0f : std::min(g[i], 0.0f);
    std::fill_n(ad, end, 0.0f);
    multiply(work.way, ad);
    float slope[lanes] = {}, curvature[lanes] = {}, feasible[lanes];
    std::fill_n(feasible, lanes, std::numeric_limits<float>::infinity());
    for (std::size_t k = 0; k < end; k += lanes)
      for (std::size_t l = 0; l < lanes; ++l) {
        const std::size_t i = k + l;
        slope[l] += g[i] * d[i], curvature[l] += d[i] * ad[i];
        const float until = (y[i] - low[i]) / d[i];
        feasible[l] = d[i] > 0 ? std::min(feasible[l], until) : feasible[l];
      }
    const float bent = total(curvature);
    if (!(bent > 0)) return -1;
    const float length = total(slope) / bent, most_length = *std::min_element(feasible, feasible + lanes);
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
      std::copy_n(b.data(), n, g);
      multiply(x, g);
    } else if (!release) {
      float turn[lanes] = {};
      for (std::size_t k = 0; k < end; k += lanes)
        for (std::size_t l = 0; l < lanes; ++l)
          turn[l] += (y[k + l] > low[k + l] ? g[k + l] : 0.0f) * ad[k + l];
      back = total(turn) / bent;
    }
    for (std::size_t i = 0; i < end; ++i) d[i] = (y[i] > low[i] ? g[i] : 0.0f) - back * d[i];
  }
  return -1;
}

}  // namespace palpate
