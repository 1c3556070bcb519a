#include "palpate/contact/normal_compliance.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/base/clones.hpp"
#include "palpate/contact/lanes.hpp"
#include "palpate/contact/solver.hpp"

namespace palpate {

namespace {

constexpr double much_turned = 0.1;     // rad
constexpr double inverse_turned = 0.2;  // of a preconditioner's row, rad: it is no worse
// Of the norm, by what rows may add: it makes steps shorter.
constexpr float hardly_grown = 1.25f;
// One stale row in so many: all at once are faster then.
constexpr std::size_t many = 4;

// out[j] = w . C_j n_j, in whole lanes: C_j the 3 x 3 compliance between the row's slot and slot j, n_j in
// planes ld apart.
PALPATE_CLONES void along_normals(const float* row, std::size_t slots, const float* w, const float* n,
                                  std::size_t ld, float* out) noexcept {
  const float wx = w[0], wy = w[1], wz = w[2];
  for (std::size_t k = 0; k < slots; k += lanes) {
    Lanes sum = {};
    for (std::size_t b = 0; b < 3; ++b) {
      const float *x = row + element_at(k, 0, b), *y = row + element_at(k, 1, b),
                  *z = row + element_at(k, 2, b);
      sum += ((at(x) * wx + at(y) * wy) + at(z) * wz) * at(n + b * ld + k);
    }
    at(out + k) = sum;
  }
}

}  // namespace

NormalCompliance::NormalCompliance(std::size_t plane, std::size_t points)
    : ld_(most(plane, points)),
      values_(ld_ * ld_),
      row_of_(points),
      slot_(ld_, -1),
      compliance_row_(ld_, -1),
      scale_(ld_, 1.0),
      normal_(ld_, Vec3::Zero()),
      normals_(3 * ld_),
      stale_(ld_),
      taken_(ld_),
      is_another_(ld_),
      made_(ld_),
      sums_(ld_),
      work_(3 * ld_),
      inverse_(ld_),
      inverse_of_(ld_, -1),
      inverse_normal_(ld_, Vec3::Zero()) {
  std::fill_n(values_.data(), values_.size(), 0.0f);  // touch every page now, not in the first ticks
}

// A row for each point: its slot's, or where that is taken (a node of two instruments, or in a grip) one
// behind those of all slots.
void NormalCompliance::find_rows(const ContactBlock& block, std::span<const ContactPoint> points,
                                 double turned) noexcept {
  const std::size_t slots = block.used();
  for (std::size_t k = slots; k < size_; ++k) compliance_row_[k] = -1;  // they miss what changes meanwhile
  size_ = slots;
  std::fill_n(taken_.begin(), slots, std::uint8_t{0});
  for (std::size_t k = 0; k < slots; ++k) {
    slot_[k] = static_cast<Index>(k);
    stale_[k] = compliance_row_[k] != block.row_of(slot_[k]) || compliance_row_[k] < 0;
    if (stale_[k]) normal_[k].setZero();
  }
  const auto place = [&](std::size_t k, const ContactPoint& c) {
    if (!stale_[k] && (normal_[k] - c.normal).squaredNorm() <= turned * turned) return;
    stale_[k] = 1;
    // A row that is another adds no more than its own element, however often it changes.
    if ((normal_[k] - c.normal).squaredNorm() > much_turned * much_turned &&
        !std::exchange(is_another_[k], std::uint8_t{1}))
      ++norm_;
    const double own = c.normal.dot(block.own(c.slot) * c.normal);
    normal_[k] = c.normal, scale_[k] = own > 0 ? 1 / std::sqrt(own) : 1;
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    auto k = static_cast<std::size_t>(points[i].slot);
    if (std::exchange(taken_[k], std::uint8_t{1})) {
      k = size_++;
      slot_[k] = points[i].slot, stale_[k] = 1, normal_[k].setZero();
    }
    row_of_[i] = static_cast<Index>(k);
    place(k, points[i]);
  }
  for (std::size_t k = 0; k < slots; ++k)
    if (stale_[k] && !taken_[k]) normal_[k].setZero(), scale_[k] = 1;
  for (std::size_t k = 0; k < size_; ++k)
    if (stale_[k]) compliance_row_[k] = k < slots ? block.row_of(slot_[k]) : -1;
  for (std::size_t b = 0; b < 3; ++b) {
    float* const normals = normals_.data() + b * ld_;
    for (std::size_t k = 0; k < slots; ++k)
      if (stale_[k]) normals[k] = static_cast<float>(scale_[k] * normal_[k][static_cast<int>(b)]);
    std::fill(normals + slots, normals + (slots + lanes - 1) / lanes * lanes, 0.0f);
  }
}

void NormalCompliance::make_row(const ContactBlock& block, std::size_t k) noexcept {
  const std::size_t slots = block.used();
  const Vec3f w = (scale_[k] * normal_[k]).cast<float>();
  along_normals(block.row(slot_[k]), slots, w.data(), normals_.data(), ld_, made_.data());
  for (std::size_t j = slots; j < size_; ++j) {
    const Mat3 c = block.between(slot_[k], slot_[j]);
    made_[j] = static_cast<float>(scale_[k] * scale_[j] * normal_[k].dot(c * normal_[j]));
  }
  std::copy_n(made_.data(), k, values_.data() + k * ld_);
  for (std::size_t j = k + 1; j < size_; ++j) values_[j * ld_ + k] = made_[j];
}

// All rows at once, and the norm: no eigenvalue exceeds the largest sum of a row's sizes.
void NormalCompliance::make_all(const ContactBlock& block, bool rough) noexcept {
  const std::size_t slots = block.used();
  rough_ = block.along_normals(normals_, ld_, rough, values_.data(), sums_, work_);
  for (std::size_t k = slots; k < size_; ++k) {
    make_row(block, k);
    sums_[k] = 1;
    for (std::size_t j = 0; j < k; ++j) {
      const float size = std::abs(values_[k * ld_ + j]);
      sums_[k] += size, sums_[j] += size;
    }
  }
  norm_ = 1;
  for (std::size_t k = 0; k < size_; ++k) norm_ = std::max(norm_, sums_[k]);
  found_norm_ = norm_, made_since_ = 0;
  std::fill(is_another_.begin(), is_another_.end(), std::uint8_t{0});
}

// Rows of new points and of those that turned, and whatever has them for columns.
void NormalCompliance::renew_inverse() noexcept {
  bool any = false;
  for (std::size_t k = 0; k < size_; ++k) {
    const bool is_new = compliance_row_[k] < 0 || inverse_of_[k] != compliance_row_[k] ||
                        (inverse_normal_[k] - normal_[k]).squaredNorm() > inverse_turned * inverse_turned;
    stale_[k] = is_new, any = any || is_new;
    if (is_new) inverse_of_[k] = compliance_row_[k], inverse_normal_[k] = normal_[k];
  }
  for (std::size_t k = 0; any && k < size_; ++k) {
    const auto columns = inverse_.columns(k);
    if (stale_[k] || std::any_of(columns.begin(), columns.end(),
                                 [&](Index j) { return stale_[static_cast<std::size_t>(j)]; }))
      inverse_.set(values_.data(), ld_, k);
  }
}

void NormalCompliance::update(const ContactBlock& block, std::span<const ContactPoint> points,
                              double turned) noexcept {
  find_rows(block, points, turned);
  const auto stale = static_cast<std::size_t>(
      std::count(stale_.begin(), stale_.begin() + static_cast<std::ptrdiff_t>(size_), 1));
  made_since_ += stale;
  // Two points of a node, or two places, may differ by less than what is rough.
  const bool rough = turned > 0 && size_ == block.used() && !block.has_combined();
  if (many * stale > size_ || made_since_ > size_ || norm_ > hardly_grown * found_norm_ ||
      (rough_ && !rough)) {
    find_rows(block, points, 0);  // with the normals that have turned by less
    make_all(block, rough);
  } else {
    for (std::size_t k = 0; k < size_; ++k)
      if (stale_[k]) make_row(block, k);
  }
  for (std::size_t k = 0; k < size_; ++k) {
    values_[k * ld_ + k] = 1;
    // The squares on the diagonal.
    for (std::size_t j = k / lanes * lanes; j < k; ++j) values_[j * ld_ + k] = values_[k * ld_ + j];
  }
  renew_inverse();
}

}  // namespace palpate
