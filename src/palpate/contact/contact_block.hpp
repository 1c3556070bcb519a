// The part of the compliance between the nodes in contact, gathered once and kept while they stay: a tick
// adds a few rows and columns. Nodes that are only watched have columns and no rows: what moves is known of
// them, what a force on them would do is not; so the products of a solver stay small enough for the cache.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "palpate/base/huge_array.hpp"
#include "palpate/compliance/compliance.hpp"

namespace palpate {

// Work space for at most `capacity` nodes of a compliance of `rows` nodes, `watched` and `combined` besides;
// nothing is allocated after construction.
class ContactBlock {
 public:
  ContactBlock(std::size_t capacity, std::size_t watched, std::size_t rows, std::size_t combined = 0);

  // Makes slots for these compliance rows, distinct, at most capacity; and for the watched ones while there
  // is room. Rows of earlier calls stay cached; drop: while they are not too many. What is watched does not
  // decide which rows are loadable, so of a storage that does not mirror bits those of a loadable row depend
  // on the earlier calls' rows alone.
  void require(const Compliance& compliance, std::span<const Index> rows, std::span<const Index> watched = {},
               bool drop = true) noexcept;
  // A loadable slot for a point that rides on three nodes, until the next call of require(): its displacement
  // is the weighted mean of theirs, a force on it acts on them by these weights. slots: of the nodes,
  // loadable; -1: one that cannot move. The weights and the nodes' rows decide its bits.
  Index combine(const std::array<Index, 3>& slots, const Vec3& weights) noexcept;
  // Row a of a loadable slot, a = x, y, z: x of all slots, from plane() on y of all, from 2 plane() on z.
  const float* row(Index slot, int a) const noexcept {
    return values_.data() + static_cast<std::size_t>(3 * slot + a) * 3 * plane_;
  }
  std::size_t plane() const noexcept { return plane_; }
  // A slot's vector of what displacements() and add_displacements() fill.
  template <class Scalar>
  Vec3 in_planes(std::span<const Scalar> u, Index slot) const noexcept {
    const Scalar* x = u.data() + slot;
    return Eigen::Matrix<Scalar, 3, 1>(x[0], x[plane_], x[2 * plane_]).template cast<double>();
  }
  // C between two slots, the first loadable, m/N.
  Mat3 between(Index i, Index j) const noexcept;
  // Of a slot's node under forces on loadable ones, m: their order decides the bits, not that of the slots.
  Vec3 displacement(Index slot, std::span<const Index> loaded, std::span<const Vec3> forces) const noexcept;
  // The same of a node that has no slot, from its three rows of C against the loaded nodes, 3 forces.size()
  // numbers each; to the same bits.
  static Vec3 displacement(const float* rows, std::span<const Vec3> forces) noexcept;
  // The same of some slots at once, and of all; in planes as a row: 3 plane() numbers.
  void displacements(std::span<const Index> loaded, std::span<const Vec3> forces, Index first, Index last,
                     std::span<double> u) const noexcept;
  void displacements(std::span<const Index> loaded, std::span<const Vec3> forces,
                     std::span<double> u) const noexcept;
  // u += of a force on one slot, in float32, of the loadable ones.
  void add_displacements(Index loaded, const Vec3& force, std::span<float> u) const noexcept;
  // Slot of a compliance row, -1: not cached.
  Index slot_of(Index row) const noexcept { return slot_of_row_[static_cast<std::size_t>(row)]; }
  bool is_loadable(Index slot) const noexcept {
    return slot >= 0 && static_cast<std::size_t>(slot) < first_watched_;
  }
  std::size_t capacity() const noexcept { return capacity_; }
  // Loadable slots in use: the first ones.
  std::size_t used() const noexcept { return used_ + combined_; }
  // The same in whole sixteens: products run over no less, and leave anything in what is not used.
  std::size_t width() const noexcept { return (used() + 15) / 16 * 16; }

 private:
  std::span<Index> rows_of(std::size_t first, std::size_t count) noexcept {
    return {row_of_slot_.data() + first, count};
  }
  float* values_of(std::size_t slot, std::size_t a) noexcept {
    return values_.data() + (3 * slot + a) * 3 * plane_;
  }
  void displace(std::span<const Index> loaded, std::span<const Vec3> forces, std::size_t first,
                std::size_t count, double* u) const noexcept;
  template <class Move>
  std::size_t keep_wanted(std::size_t first, std::size_t last, Move&& move) noexcept;
  void drop_unwanted() noexcept;
  void drop_unwatched() noexcept;
  void move_column(std::size_t from, std::size_t to) noexcept;
  void fetch(const Compliance& compliance, std::size_t first, std::size_t last) noexcept;
  void fetch_watched(const Compliance& compliance, std::size_t first, std::size_t last) noexcept;

  std::size_t capacity_, watchable_, first_watched_, plane_, used_ = 0, combined_ = 0, watched_ = 0;
  HugeArray<float> values_;           // 3 rows of 3 planes a loadable slot, m/N
  std::vector<float> fetched_;        // rows as a compliance gives them
  std::vector<Index> slot_of_row_;    // slot of each compliance row, -1: not cached
  std::vector<Index> row_of_slot_;    // its inverse
  std::vector<std::uint8_t> wanted_;  // of each slot, in this call
};

}  // namespace palpate
