// Small dense symmetric systems inside the tick: no allocation, no lock (so not OpenBLAS).
#pragma once

#include <cstddef>

namespace palpate {

// Factors the upper triangle of the row-major n x n matrix `a` (leading dimension ld) as U^T U in place; the
// strict lower triangle is neither read nor written. False where a pivot is not positive: `a` is then spoilt.
bool cholesky(double* a, std::size_t n, std::size_t ld) noexcept;
// Solves U^T U x = b in place.
void cholesky_solve(const double* u, std::size_t n, std::size_t ld, double* b) noexcept;

}  // namespace palpate
