#include "palpate/contact/sparse_inverse.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

constexpr float least_pivot = 0.05f;  // less is two points of one node, and no stiffness of their own

}  // namespace

SparseInverse::SparseInverse(std::size_t rows) : columns_(rows), values_(rows) {
  for (std::size_t i = 0; i < rows; ++i) {
    columns_[i].fill(static_cast<Index>(i));
    values_[i] = {}, values_[i][others] = 1;
  }
}

void SparseInverse::set(const float* a, std::size_t ld, std::size_t i) noexcept {
  constexpr std::size_t m = others + 1;
  std::array<Index, others>& columns = columns_[i];
  columns.fill(static_cast<Index>(i));
  std::array<float, others> sizes{};  // descending
  for (std::size_t j = 0; j < i; ++j) {
    const float size = std::abs(a[i * ld + j]);
    if (!(size > sizes[others - 1])) continue;
    std::size_t k = others - 1;
    for (; k > 0 && size > sizes[k - 1]; --k) sizes[k] = sizes[k - 1], columns[k] = columns[k - 1];
    sizes[k] = size, columns[k] = static_cast<Index>(j);
  }
  // The last column of the inverse of A among these and i, over the root of its last element: with A = L L^T,
  // that is the last row of L^-1.
  std::array<std::size_t, m> of;
  for (std::size_t k = 0; k < m; ++k) of[k] = k < others ? static_cast<std::size_t>(columns[k]) : i;
  std::array<std::array<float, m>, m> l{};
  for (std::size_t p = 0; p < m; ++p) {
    for (std::size_t q = 0; q <= p; ++q) {
      const bool none = of[q] == i || (p < others && of[p] == i);  // there is no such column
      float sum = p == q ? 1.0f : none ? 0.0f : a[std::max(of[p], of[q]) * ld + std::min(of[p], of[q])];
      for (std::size_t k = 0; k < q; ++k) sum -= l[p][k] * l[q][k];
      l[p][q] = p == q ? std::sqrt(std::max(sum, least_pivot)) : sum / l[q][q];
    }
  }
  std::array<float, m>& g = values_[i];  // 0 where there is no column
  for (std::size_t k = m; k-- > 0;) {
    float sum = k == others ? 1.0f : 0.0f;
    for (std::size_t p = k + 1; p < m; ++p) sum -= l[p][k] * g[p];
    g[k] = sum / l[k][k];
  }
}

void SparseInverse::apply(std::size_t n, const float* r, float* z) const noexcept {
  std::fill_n(z, n, 0.0f);
  for (std::size_t i = 0; i < n; ++i) {
    const auto& [p, q, s] = columns_[i];
    const std::array<float, others + 1>& g = values_[i];
    const float sum = (g[0] * r[p] + g[1] * r[q]) + (g[2] * r[s] + g[3] * r[i]);
    z[p] += g[0] * sum, z[q] += g[1] * sum, z[s] += g[2] * sum, z[i] += g[3] * sum;
  }
}

}  // namespace palpate
