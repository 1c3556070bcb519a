// The inner loops of Compliance::apply: weighted sums of rows, limited by memory bandwidth; and of the
// hierarchical storage.
#pragma once

#include <cstddef>
#include <cstdint>

namespace palpate {

inline constexpr std::size_t rows_at_once = 24;

// u[i] += sum over k < count of weights[k] rows[k][i], i < n, in the order of k: the same bits whatever the
// CPU. count <= rows_at_once.
void add_rows(const float* const* rows, const float* weights, std::size_t count, std::size_t n,
              float* u) noexcept;
// The same, rows of float16.
void add_rows(const std::uint16_t* const* rows, const float* weights, std::size_t count, std::size_t n,
              float* u) noexcept;

// y[j] += a_j . x, j < n, a_j being column j of a: m x n, column-major. The same bits whatever the CPU.
void add_dots(const float* a, std::size_t m, std::size_t n, const float* x, float* y) noexcept;

}  // namespace palpate
