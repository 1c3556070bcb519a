// The inner loop of Compliance::apply: a weighted sum of rows, limited by memory bandwidth.
#pragma once

#include <cstddef>

namespace palpate {

inline constexpr std::size_t rows_at_once = 12;

// u[i] += sum over k < count of weights[k] rows[k][i], i < n, in the order of k: the same bits whatever the
// CPU. count <= rows_at_once.
void add_rows(const float* const* rows, const float* weights, std::size_t count, std::size_t n,
              float* u) noexcept;

}  // namespace palpate
