// N^T C N, the compliance of the points along their normals, scaled to a diagonal of 1. It is kept from tick
// to tick: rows of new points, and of those whose normal has turned, are made anew, or all where that is
// faster.
#pragma once

#include <span>
#include <vector>

#include "palpate/contact/contact_block.hpp"
#include "palpate/contact/sparse_inverse.hpp"

namespace palpate {

struct ContactPoint;

class NormalCompliance {
 public:
  // For points on the slots of such blocks, at most `points` of them. Nothing is allocated after
  // construction.
  NormalCompliance(std::size_t plane, std::size_t points);

  // For these points, whose slots are the block's. Rows stay where the normal has turned by less than
  // `turned` (rad): they are then off by as much. Where `turned` is above 0, rows of many points may be from
  // 16 bits, too (SymmetricHalf::along_normals()).
  void update(const ContactBlock& block, std::span<const ContactPoint> points, double turned) noexcept;

  // Rows there are: of each slot one, whether a point is there or not, and of further points of a slot.
  std::size_t size() const noexcept { return size_; }
  static std::size_t most(std::size_t plane, std::size_t points) noexcept {
    return (plane + points + 15) / 16 * 16;
  }
  std::size_t row_of(std::size_t point) const noexcept { return static_cast<std::size_t>(row_of_[point]); }
  // Of a point: the square root of its own stiffness, sqrt(N / m).
  double scale(std::size_t point) const noexcept { return scale_[row_of(point)]; }
  float between(std::size_t p, std::size_t q) const noexcept {
    const std::size_t i = std::max(row_of(p), row_of(q)), j = std::min(row_of(p), row_of(q));
    return values_[i * ld_ + j];
  }
  // By rows, `ld` apart, as multiply_symmetric() takes them, and no less than the largest eigenvalue but for
  // what little turned normals add to it.
  const float* values() const noexcept { return values_.data(); }
  std::size_t ld() const noexcept { return ld_; }
  float norm() const noexcept { return norm_; }
  // About its inverse.
  const SparseInverse& inverse() const noexcept { return inverse_; }

 private:
  void find_rows(const ContactBlock& block, std::span<const ContactPoint> points, double turned) noexcept;
  void renew_inverse() noexcept;
  void make_row(const ContactBlock& block, std::size_t row) noexcept;
  void make_all(const ContactBlock& block, bool rough) noexcept;

  std::size_t ld_, size_ = 0;
  HugeArray<float> values_;
  float norm_ = 0, found_norm_ = 0;
  bool rough_ = false;                       // rows may be from 16 bits
  std::size_t made_since_ = 0;               // rows, since all were made
  std::vector<Index> row_of_;                // of each point
  std::vector<Index> slot_;                  // of each row
  std::vector<Index> compliance_row_;        // that the slot had when the row was made
  std::vector<double> scale_;                // of each row
  std::vector<Vec3> normal_;                 // that the row was made with; zero: no point
  std::vector<float> normals_;               // of the slots, scaled, in planes ld_ apart
  std::vector<std::uint8_t> stale_, taken_;  // of each row
  std::vector<std::uint8_t> is_another_;     // of each row: than when the norm was found
  std::vector<float> made_, sums_, work_;
  SparseInverse inverse_;
  std::vector<Index> inverse_of_;     // of each of its rows: the compliance row,
  std::vector<Vec3> inverse_normal_;  // and the normal it was made with
};

}  // namespace palpate
