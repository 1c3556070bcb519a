// C = (K^-1)_SS: displacement of surface nodes per force on surface nodes, m/N. One interface for all
// storages; today: dense float32.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "palpate/base/huge_array.hpp"
#include "palpate/base/progress.hpp"
#include "palpate/base/vec.hpp"

namespace palpate {

// Symmetric positive definite. Const and thread-safe; none of the queries allocates.
class Compliance {
 public:
  Compliance() = default;
  // matrix: (3 nodes)^2, row-major, full.
  static Compliance dense(HugeArray<float> matrix, std::size_t nodes);

  std::size_t nodes() const noexcept { return nodes_; }
  const char* storage() const noexcept { return "dense float32"; }
  std::size_t bytes() const noexcept { return matrix_.size() * sizeof(float); }
  std::span<const float> matrix() const noexcept { return matrix_; }

  // u = C f for forces on a few nodes: u (3 nodes() floats, m) is overwritten; forces: 3 contacts.size()
  // floats, N.
  void apply(std::span<const Index> contacts, std::span<const float> forces,
             std::span<float> u) const noexcept;
  // The 3 contacts x 3 contacts block, row-major with leading dimension `ld` (>= 3 contacts.size()).
  void block(std::span<const Index> contacts, std::span<float> out, std::size_t ld) const noexcept;
  // A rectangular block: rows of `rows`, columns of `columns`, row-major, leading dimension ld. For adding
  // contacts a few at a time.
  void block(std::span<const Index> rows, std::span<const Index> columns, std::span<float> out,
             std::size_t ld) const noexcept;
  // u at `rows` only, for forces on `contacts`.
  void apply_at(std::span<const Index> rows, std::span<const Index> contacts, std::span<const float> forces,
                std::span<float> u) const noexcept;

 private:
  HugeArray<float> matrix_;
  std::size_t nodes_ = 0;
};

}  // namespace palpate
