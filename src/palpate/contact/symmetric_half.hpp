// Half of a symmetric matrix of 3 x 3 blocks, packed in the order in which a product reads it: one stream,
// which is what limits the product where the matrix is larger than the cache.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "palpate/base/huge_array.hpp"

namespace palpate {

// Where element (a, b) of the block in column j stands in a row of blocks: one stream, of eight columns each
// element in turn.
constexpr std::size_t element_at(std::size_t j, std::size_t a = 0, std::size_t b = 0) noexcept {
  return (j / 8 * 9 + 3 * a + b) * 8 + j % 8;
}

class SymmetricHalf {
 public:
  // Of at most so many blocks a side; all zero.
  explicit SymmetricHalf(std::size_t capacity);

  // Block row i, and by symmetry column i, of the first n, as element_at() says. Reads whole eights.
  void set(std::size_t i, const float* row, std::size_t n) noexcept;
  // u += A f over the first n blocks: x of all, from plane on y of all, from 2 plane on z. Whole sixteens:
  // beyond n f is zero, and u anything.
  void add_product(std::size_t n, std::size_t plane, std::span<const float> f,
                   std::span<float> u) const noexcept;
  // The same from half the bytes, of an A that is positive semidefinite: of 16 bits each element over the
  // roots of its row's and its column's diagonal elements, which none exceeds. False, and u as it was, where
  // that would put more than `off` on u, root mean square. work: 6 plane numbers.
  bool add_rough_product(std::size_t n, std::size_t plane, std::span<const float> f, float off,
                         std::span<float> u, std::span<float> work) const noexcept;
  // n_i . A_ij n_j for the first n blocks and each block's columns up to its own eight: out[i ld + j], in
  // whole eights of rows. sums: of each row's sizes, by symmetry its whole row's. normals: x of all, from ld
  // on y, from 2 ld on z; zero from n to the next eight. rough: from 16 bits as above, where that is faster
  // (true), each off by 1e-5 of the root of its row's and its column's diagonal element, root mean square.
  // work: 3 ld numbers.
  bool along_normals(std::size_t n, std::span<const float> normals, std::size_t ld, bool rough, float* out,
                     std::span<float> sums, std::span<float> work) const noexcept;
  // Block (i, i), by rows.
  const std::array<float, 9>& own(std::size_t i) const noexcept { return own_[i]; }

 private:
  HugeArray<float> values_;
  HugeArray<std::int32_t> pairs_;                     // of two rows that stand together, in the same order
  std::array<std::vector<float>, 3> size_, inverse_;  // of x, y, z of each block row: that root; one over it
  std::vector<std::array<float, 9>> own_;
};

}  // namespace palpate
