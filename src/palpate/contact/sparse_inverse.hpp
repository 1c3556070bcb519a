// A preconditioner for conjugate gradients on N^T C N: an inverse in sparse factors, A^-1 ~ G^T G. What one
// pressure does decays slowly with the distance, but what it takes to move one point alone is pressures right
// beside it, so the inverse is nearly zero farther off. G is lower triangular, and each of its rows the best
// on its own few elements. Kolotilina, Yeremin, "Factorized sparse approximate inverse preconditionings I"
// (1993). Positive definite whatever the elements.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "palpate/base/vec.hpp"

namespace palpate {

class SparseInverse {
 public:
  static constexpr std::size_t others = 3;  // elements of a row of G beside the diagonal's; more gain little
  // Of at most so many rows; the identity until set() is called. Nothing is allocated later.
  explicit SparseInverse(std::size_t rows);

  // Row i of G, from the rows of A up to i's, of which the lower triangle is read: rows `ld` apart, a
  // diagonal of 1. Its columns are those of which row i has the largest elements.
  void set(const float* a, std::size_t ld, std::size_t i) noexcept;
  // Columns of row i beside its own; i itself: there is none.
  std::span<const Index, others> columns(std::size_t i) const noexcept {
    return std::span<const Index, others>(columns_[i]);
  }
  // z = G^T G r, of the first n rows.
  void apply(std::size_t n, const float* r, float* z) const noexcept;

 private:
  std::vector<std::array<Index, others>> columns_;
  std::vector<std::array<float, others + 1>> values_;  // the diagonal's last
};

}  // namespace palpate
