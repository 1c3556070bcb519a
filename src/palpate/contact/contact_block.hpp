// The part of the compliance between the nodes in contact, gathered once and kept while they stay: a tick
// adds a few rows and columns.
#pragma once

#include <span>
#include <vector>

#include "palpate/base/huge_array.hpp"
#include "palpate/compliance/compliance.hpp"

namespace palpate {

// Work space for at most `capacity` nodes of a compliance of `rows` nodes; nothing is allocated after
// construction.
class ContactBlock {
 public:
  ContactBlock(std::size_t capacity, std::size_t rows);

  // Makes slots for these compliance rows (distinct, at most capacity) and fills slots_of[i] with the slot of
  // rows[i]. Rows of earlier calls stay cached while there is room.
  void require(const Compliance& compliance, std::span<const Index> rows, std::span<Index> slots_of) noexcept;
  // C between two slots, row-major with leading dimension ld().
  const float* at(Index i, Index j) const noexcept {
    return values_.data() + static_cast<std::size_t>(3 * i) * ld() + static_cast<std::size_t>(3 * j);
  }
  // Of a slot's node under forces on others, m: their order decides the bits, not that of the slots.
  Vec3 displacement(Index slot, std::span<const Index> loaded, std::span<const Vec3> forces) const noexcept;
  // The same of all slots at once: 3 used() numbers.
  void displacements(std::span<const Index> loaded, std::span<const Vec3> forces,
                     std::span<double> u) const noexcept;
  // Slot of a compliance row, -1: not cached.
  Index slot_of(Index row) const noexcept { return slot_of_row_[static_cast<std::size_t>(row)]; }
  std::size_t capacity() const noexcept { return capacity_; }
  std::size_t ld() const noexcept { return 3 * capacity_; }
  std::size_t used() const noexcept { return used_; }

 private:
  void drop_unwanted() noexcept;

  std::size_t capacity_, used_ = 0;
  HugeArray<float> values_;           // (3 capacity)^2, m/N
  std::vector<Index> slot_of_row_;    // slot of each compliance row, -1: not cached
  std::vector<Index> row_of_slot_;    // its inverse, `used_` entries valid
  std::vector<std::uint8_t> wanted_;  // of each slot, in this call
};

}  // namespace palpate
