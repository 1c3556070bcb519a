// Linear complementarity by block pivoting: p >= 0, w = A p + b >= 0, p.w = 0, A symmetric positive definite.
// Judice, Pires, "A block principal pivoting algorithm for large-scale strictly monotone linear
// complementarity problems" (1994): all wrong signs are exchanged at once while that reduces their number,
// one at a time (Murty 1974) when it does not; finite either way. Some rows may be bilateral: w = 0, p of any
// sign.
#pragma once

#include <cstdint>
#include <span>

namespace palpate {

// In the active set: a bilateral row; it stays one.
constexpr std::uint8_t bilateral = 2;
constexpr std::uint8_t not_factored = 3;

struct ComplementarityWork {
  std::span<double> matrix;       // n x n
  std::span<double> vector;       // n
  std::span<std::int32_t> index;  // n
  // n flags: the active set that `matrix` and `index` hold the factor of, for another call with the same A;
  // all not_factored: none. May be empty.
  std::span<std::uint8_t> factored = {};
};

// a: row-major n x n, leading dimension ld, full. active (n flags) is the start and receives the answer: 1
// where p > 0, and keeps its bilateral rows. Returns the number of factorisations; 0 when `most` were not
// enough or A is not positive definite: p then holds the last try, or what it held before, with negative
// entries set to zero.
int solve_complementarity(const double* a, std::size_t n, std::size_t ld, const double* b,
                          std::span<std::uint8_t> active, std::span<double> p,
                          const ComplementarityWork& work, int most = 60) noexcept;

}  // namespace palpate
