// Right-looking Cholesky by rows of U (Golub, Van Loan, Matrix Computations, 4.2): every inner loop runs
// along a row, which compilers vectorise without reordering a sum. Four pivots are applied at once, so a row
// is loaded and stored once for four updates.
#include "palpate/contact/dense_cholesky.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/base/clones.hpp"

namespace palpate {

PALPATE_CLONES bool cholesky(double* a, std::size_t n, std::size_t ld) noexcept {
  constexpr std::size_t block = 4;
  for (std::size_t k = 0; k < n; k += block) {
    const std::size_t b = std::min(block, n - k);
    for (std::size_t p = k; p < k + b; ++p) {  // factor the block's rows, each over its whole length
      double* rp = a + p * ld;
      for (std::size_t q = k; q < p; ++q) {
        const double* rq = a + q * ld;
        const double f = rq[p];
        for (std::size_t j = p; j < n; ++j) rp[j] -= f * rq[j];
      }
      if (!(rp[p] > 0)) return false;
      const double inverse = 1 / std::sqrt(rp[p]);
      for (std::size_t j = p; j < n; ++j) rp[j] *= inverse;
    }
    if (b < block) break;
    const double *r0 = a + k * ld, *r1 = r0 + ld, *r2 = r1 + ld, *r3 = r2 + ld;
    for (std::size_t i = k + block; i < n; ++i) {
      double* ri = a + i * ld;
      const double f0 = r0[i], f1 = r1[i], f2 = r2[i], f3 = r3[i];
      for (std::size_t j = i; j < n; ++j) ri[j] -= f0 * r0[j] + f1 * r1[j] + (f2 * r2[j] + f3 * r3[j]);
    }
  }
  return true;
}

PALPATE_CLONES void cholesky_solve(const double* u, std::size_t n, std::size_t ld, double* b) noexcept {
  for (std::size_t k = 0; k < n; ++k) {  // U^T y = b
    const double* r = u + k * ld;
    const double y = b[k] /= r[k];
    for (std::size_t j = k + 1; j < n; ++j) b[j] -= y * r[j];
  }
  for (std::size_t k = n; k-- > 0;) {  // U x = y
    const double* r = u + k * ld;
    double sum[8] = {};
    std::size_t j = k + 1;
    for (; j + 8 <= n; j += 8)
      for (std::size_t l = 0; l < 8; ++l) sum[l] += r[j + l] * b[j + l];
    for (; j < n; ++j) sum[0] += r[j] * b[j];
    b[k] =
        (b[k] - (((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7])))) / r[k];
  }
}

}  // namespace palpate
