#include "palpate/contact/complementarity.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/contact/dense_cholesky.hpp"

namespace palpate {

namespace {

// p on the active set from A_SS p_S = -b_S, zero elsewhere. False: not positive definite.
bool solve_active(const double* a, std::size_t n, std::size_t ld, const double* b,
                  std::span<const std::uint8_t> active, std::span<double> p,
                  const ComplementarityWork& work) noexcept {
  const bool known = !work.factored.empty() &&
                     std::equal(work.factored.begin(), work.factored.begin() + static_cast<std::ptrdiff_t>(n),
                                active.begin());
  std::size_t m = 0;
  for (std::size_t i = 0; i < n; ++i)
    if (active[i]) work.index[m++] = static_cast<std::int32_t>(i);
  for (std::size_t r = 0; r < m; ++r) work.vector[r] = -b[work.index[r]];
  for (std::size_t r = 0; r < m && !known; ++r) {
    const double* row = a + static_cast<std::size_t>(work.index[r]) * ld;
    double* out = work.matrix.data() + r * m;
    for (std::size_t c = r; c < m; ++c) out[c] = row[work.index[c]];
  }
  if (!known) {
    if (!work.factored.empty()) std::fill_n(work.factored.begin(), n, not_factored);
    if (!cholesky(work.matrix.data(), m, m)) return false;
    if (!work.factored.empty()) std::copy_n(active.begin(), n, work.factored.begin());
  }
  cholesky_solve(work.matrix.data(), m, m, work.vector.data());
  std::fill(p.begin(), p.begin() + static_cast<std::ptrdiff_t>(n), 0.0);
  for (std::size_t r = 0; r < m; ++r) p[static_cast<std::size_t>(work.index[r])] = work.vector[r];
  return true;
}

}  // namespace

int solve_complementarity(const double* a, std::size_t n, std::size_t ld, const double* b,
                          std::span<std::uint8_t> active, std::span<double> p,
                          const ComplementarityWork& work, int most) noexcept {
  double largest_b = 0;
  for (std::size_t i = 0; i < n; ++i) largest_b = std::max(largest_b, std::abs(b[i]));
  const double w_floor = -1e-12 * largest_b;
  std::size_t fewest = n + 1;
  int patience = 3;
  for (int k = 1; k <= most; ++k) {
    if (!solve_active(a, n, ld, b, active, p, work)) break;
    std::copy(b, b + n, work.vector.begin());
    for (std::size_t j = 0; j < n; ++j) {  // A is symmetric: its rows are its columns, and run along memory
      if (p[j] == 0) continue;
      const double* row = a + j * ld;
      for (std::size_t i = 0; i < n; ++i) work.vector[i] += p[j] * row[i];
    }
    std::size_t wrong = 0, last_wrong = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const bool bad = active[i] == bilateral ? false : active[i] ? p[i] < 0 : work.vector[i] < w_floor;
      work.vector[i] = bad;
      if (bad) ++wrong, last_wrong = i;
    }
    if (wrong == 0) return k;
    if (wrong < fewest) {
      fewest = wrong;
      patience = 3;
    } else if (patience > 0) {
      --patience;
    } else {
      active[last_wrong] ^= 1;  // Murty: the largest index alone
      continue;
    }
    for (std::size_t i = 0; i < n; ++i)
      if (work.vector[i] != 0) active[i] ^= 1;
  }
  for (std::size_t i = 0; i < n; ++i)
    if (active[i] != bilateral) p[i] = std::max(p[i], 0.0);
  return 0;
}

}  // namespace palpate
