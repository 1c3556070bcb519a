#include "palpate/contact/contact_block.hpp"

#include <algorithm>

#include "palpate/contact/dense_cholesky.hpp"

namespace palpate {

ContactBlock::ContactBlock(std::size_t capacity, std::size_t rows)
    : capacity_(capacity),
      values_(9 * capacity * capacity),
      slot_of_row_(rows, -1),
      row_of_slot_(capacity, -1),
      wanted_(capacity, 0) {
  std::fill_n(values_.data(), values_.size(), 0.0f);  // touch every page now, not in the first ticks
}

Vec3 ContactBlock::displacement(Index slot, std::span<const Index> loaded,
                                std::span<const Vec3> forces) const noexcept {
  Vec3 u = Vec3::Zero();
  for (std::size_t k = 0; k < loaded.size(); ++k)
    add_rows(at(loaded[k], slot), 3, ld(), forces[k].data(), u.data());
  return u;
}

void ContactBlock::displacements(std::span<const Index> loaded, std::span<const Vec3> forces,
                                 std::span<double> u) const noexcept {
  std::fill_n(u.begin(), 3 * used_, 0.0);
  for (std::size_t k = 0; k < loaded.size(); ++k)
    add_rows(at(loaded[k], 0), 3 * used_, ld(), forces[k].data(), u.data());
}

// Keeps the wanted slots only: each is moved, whole rows and columns, into the first free place.
void ContactBlock::drop_unwanted() noexcept {
  std::size_t to = 0;
  for (std::size_t from = 0; from < used_; ++from) {
    const Index row = row_of_slot_[from];
    if (!wanted_[from]) {
      slot_of_row_[static_cast<std::size_t>(row)] = -1;
      continue;
    }
    if (to != from) {
      for (std::size_t r = 0; r < 3; ++r)
        std::copy_n(values_.data() + (3 * from + r) * ld(), 3 * used_, values_.data() + (3 * to + r) * ld());
      for (std::size_t r = 0; r < 3 * used_; ++r)
        std::copy_n(values_.data() + r * ld() + 3 * from, 3, values_.data() + r * ld() + 3 * to);
      row_of_slot_[to] = row;
      slot_of_row_[static_cast<std::size_t>(row)] = static_cast<Index>(to);
    }
    ++to;
  }
  used_ = to;
}

void ContactBlock::require(const Compliance& compliance, std::span<const Index> rows,
                           std::span<Index> slots_of) noexcept {
  std::size_t missing = 0, present = 0;
  std::fill(wanted_.begin(), wanted_.end(), std::uint8_t{0});
  for (const Index row : rows) {
    const Index slot = slot_of_row_[static_cast<std::size_t>(row)];
    if (slot < 0)
      ++missing;
    else if (!wanted_[static_cast<std::size_t>(slot)])
      wanted_[static_cast<std::size_t>(slot)] = 1, ++present;
  }
  // Every product of the solver runs over all slots: too many idle ones cost more than fetching them again.
  if (used_ + missing > capacity_ || used_ > present + present / 4 + 16) drop_unwanted();
  const std::size_t old = used_;
  for (const Index row : rows)
    if (slot_of_row_[static_cast<std::size_t>(row)] < 0) {
      slot_of_row_[static_cast<std::size_t>(row)] = static_cast<Index>(used_);
      row_of_slot_[used_++] = row;
    }
  if (used_ > old) {
    const std::span<const Index> all(row_of_slot_.data(), used_), added = all.subspan(old);
    compliance.block(added, all, {values_.data() + 3 * old * ld(), values_.size() - 3 * old * ld()}, ld());
    for (std::size_t i = 0; i < 3 * old; ++i)  // the mirror image: C is symmetric
      for (std::size_t j = 3 * old; j < 3 * used_; ++j) values_[i * ld() + j] = values_[j * ld() + i];
  }
  for (std::size_t i = 0; i < rows.size(); ++i) slots_of[i] = slot_of_row_[static_cast<std::size_t>(rows[i])];
}

}  // namespace palpate
