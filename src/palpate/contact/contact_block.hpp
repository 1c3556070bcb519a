// The part of the compliance between the nodes in contact, gathered once and kept while they stay: a tick
// adds a few rows and columns. Nodes that are only watched have rows and no columns: what moves is known of
// them, what a force on them would do is not; so the products of a solver stay small enough for the cache.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "palpate/base/huge_array.hpp"
#include "palpate/compliance/compliance.hpp"
#include "palpate/contact/symmetric_half.hpp"

namespace palpate {

// Work space for at most `capacity` nodes of a compliance of `rows` nodes, `watched` and `combined` besides;
// nothing is allocated after construction.
class ContactBlock {
 public:
  ContactBlock(std::size_t capacity, std::size_t watched, std::size_t rows, std::size_t combined = 0);

  // Makes slots for these compliance rows, distinct, at most capacity. Rows of earlier calls stay cached
  // while they are not too many; then the one wanted longest ago makes room. What is watched does not decide
  // which rows are loadable, so of a storage that does not mirror bits those of a loadable row depend on the
  // earlier calls alone.
  void require(const Compliance& compliance, std::span<const Index> rows) noexcept;
  // A slot to watch a row that is not loadable, until the next call of require(): its own, or a new one, for
  // which one makes room that was not asked for lately. -1: there are no such slots.
  Index watch(const Compliance& compliance, Index row) noexcept;
  // A loadable slot for a point that rides on three nodes, until the next call of require(): its displacement
  // is the weighted mean of theirs, a force on it acts on them by these weights. slots: of the nodes,
  // loadable; -1: one that cannot move. The weights and the nodes' rows decide its bits.
  Index combine(const std::array<Index, 3>& slots, const Vec3& weights) noexcept;
  // Of a slot, against the loadable ones: where is element_at()'s to tell. Whole eights, of which there may
  // be more than used().
  const float* row(Index slot) const noexcept { return row_of_values(static_cast<std::size_t>(slot)); }
  // Vectors of all slots, such as forces, are in planes: x of all, from plane() on y of all, from 2 plane()
  // on z.
  std::size_t plane() const noexcept { return first_watched_; }
  // A slot's vector of what displacements() and add_displacements() fill.
  template <class Scalar>
  Vec3 in_planes(std::span<const Scalar> u, Index slot) const noexcept {
    const Scalar* x = u.data() + slot;
    return Eigen::Matrix<Scalar, 3, 1>(x[0], x[plane()], x[2 * plane()]).template cast<double>();
  }
  // C between two loadable slots, m/N.
  Mat3 between(Index i, Index j) const noexcept;
  // The same of one with itself, which is at hand.
  Mat3 own(Index i) const noexcept {
    return Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(
               half_.own(static_cast<std::size_t>(i)).data())
        .cast<double>();
  }
  // C of the slots along one normal each, which is zero where there is none: SymmetricHalf::along_normals().
  bool along_normals(std::span<const float> normals, std::size_t ld, bool rough, float* out,
                     std::span<float> sums, std::span<float> work) const noexcept {
    return half_.along_normals(used(), normals, ld, rough, out, sums, work);
  }
  // Forces on some slots, none of them combined, into planes; zero elsewhere, of slots combined by then too.
  void spread(std::span<const Index> loaded, std::span<const Vec3> forces,
              std::span<float> planes) const noexcept;
  // Of a slot's node under such forces, m.
  Vec3 displacement(Index slot, std::span<const float> forces) const noexcept;
  // The same of two at once.
  std::array<Vec3, 2> displacement(Index slot, std::span<const float> forces,
                                   std::span<const float> others) const noexcept;
  // The same of a node that has no slot, from its three rows of C against the loaded nodes, 3 forces.size()
  // numbers each.
  static Vec3 displacement(const float* rows, std::span<const Vec3> forces) noexcept;
  // Of all loadable slots at once, summed in float64; in planes: 3 plane() numbers.
  void displacements(std::span<const Index> loaded, std::span<const Vec3> forces,
                     std::span<double> u) const noexcept;
  // u += of a force on one slot, in float32, of the loadable ones.
  void add_displacements(Index loaded, const Vec3& force, std::span<float> u) const noexcept;
  // u += C f over the loadable slots, in float32, f and u in planes; f is zero where there is no force. From
  // half of C, as it is symmetric: what is streamed is the limit.
  void add_product(std::span<const float> f, std::span<float> u) const noexcept;
  // The same to `off` m, root mean square, from half the bytes; false: not to be had. work: 6 plane()
  // numbers.
  bool add_rough_product(std::span<const float> f, float off, std::span<float> u,
                         std::span<float> work) const noexcept {
    return half_.add_rough_product(used(), plane(), f, off, u, work);
  }
  // Slot of a compliance row, -1: not cached.
  Index slot_of(Index row) const noexcept { return slot_of_row_[static_cast<std::size_t>(row)]; }
  bool is_loadable(Index slot) const noexcept {
    return slot >= 0 && static_cast<std::size_t>(slot) < first_watched_;
  }
  // Its inverse; -1: of a combined one.
  Index row_of(Index slot) const noexcept {
    return static_cast<std::size_t>(slot) < used_ ? row_of_slot_[static_cast<std::size_t>(slot)] : -1;
  }
  std::size_t capacity() const noexcept { return capacity_; }
  bool has_combined() const noexcept { return combined_ > 0; }
  // How often loadable slots have changed places.
  std::uint64_t moves() const noexcept { return moves_; }
  // Loadable slots in use: the first ones.
  std::size_t used() const noexcept { return used_ + combined_; }
  // The same in whole sixteens: products run over no less, and leave anything in what is not used.
  std::size_t width() const noexcept { return (used() + 15) / 16 * 16; }

 private:
  const float* row_of_values(std::size_t slot) const noexcept {
    return values_.data() + 9 * first_watched_ * slot;
  }
  float* row_of_values(std::size_t slot) noexcept { return values_.data() + 9 * first_watched_ * slot; }
  // Of a row, what is in use.
  std::size_t row_size() const noexcept { return 9 * width(); }
  Index slot_for(std::size_t allowed) noexcept;
  std::size_t place_to_watch() noexcept;
  void fill(std::size_t slot, Index row) noexcept;
  std::size_t find_filled_since(std::uint64_t fills) noexcept;
  void update_watched(const Compliance& compliance, std::size_t watched) noexcept;
  void take_watched(const Compliance& compliance, std::size_t watched, std::size_t slot) noexcept;
  void shrink(std::size_t allowed, bool may_move) noexcept;
  void mirror(std::size_t slot, std::size_t rows) noexcept;
  void row_is_made(std::size_t slot) noexcept;
  void move_slot(std::size_t from, std::size_t to) noexcept;
  void fetch(const Compliance& compliance, std::span<const Index> slots) noexcept;

  std::size_t capacity_, watchable_, first_watched_;
  std::size_t used_ = 0, combined_ = 0, watched_ = 0, next_ = 0;
  std::uint64_t moves_ = 0, calls_ = 0, fills_ = 0;
  HugeArray<float> values_;            // the slots' rows, m/N; watched ones behind the loadable
  SymmetricHalf half_;                 // of the loadable once more, for products
  std::vector<float> fetched_;         // rows as a compliance gives them
  std::vector<Index> slot_of_row_;     // slot of each compliance row, -1: not cached
  std::vector<Index> row_of_slot_;     // its inverse
  std::vector<std::uint64_t> wanted_;  // of each loadable slot: the last call that wanted it
  std::vector<std::uint64_t> filled_;  // of each loadable slot: which of the fills put its row there
  std::vector<Index> slot_of_fill_;    // of the last fills, as many as there may be loadable slots
  struct Known {
    std::uint64_t fills = 0;  // that its row knows
    bool asked = false;       // for since the last time round
  };
  std::vector<Known> known_;  // of each watched slot
  // Work space.
  std::vector<Index> added_, since_, rows_;
  std::vector<std::pair<Index, Index>> taken_;  // watched slots, and the loadable ones they become
};

}  // namespace palpate
