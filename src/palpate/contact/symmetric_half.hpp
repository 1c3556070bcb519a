// Half of a symmetric matrix of 3 x 3 blocks, packed in the order in which a product reads it: one stream,
// which is what limits the product where the matrix is larger than the cache.
#pragma once

#include <cstddef>
#include <span>

#include "palpate/base/huge_array.hpp"

namespace palpate {

class SymmetricHalf {
 public:
  // Of at most so many blocks a side; all zero.
  explicit SymmetricHalf(std::size_t capacity);

  // Block row i, and by symmetry column i, of the first n: rows[(3 a + b) plane + j] is element (a, b) of
  // block (i, j). Reads whole eights.
  void set(std::size_t i, const float* rows, std::size_t plane, std::size_t n) noexcept;
  // u += A f over the first n blocks: x of all, from plane on y of all, from 2 plane on z. Whole sixteens:
  // beyond n f is zero, and u anything.
  void add_product(std::size_t n, std::size_t plane, std::span<const float> f,
                   std::span<float> u) const noexcept;

 private:
  HugeArray<float> values_;
};

}  // namespace palpate
