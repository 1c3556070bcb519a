#include "palpate/contact/contact_block.hpp"

#include <algorithm>
#include <utility>

#include "palpate/contact/clones.hpp"

namespace palpate {

namespace {

// Three rows of C, `ld` apart, and the force along them.
struct Triple {
  const float* rows;
  float x, y, z;
};

// out += a force's part, each entry by itself, so its bits do not depend on where it stands.
PALPATE_CLONES void add(const Triple& t, std::size_t ld, std::size_t n, float* __restrict out) noexcept {
  const float *x = t.rows, *y = x + ld, *z = y + ld;
  for (std::size_t i = 0; i < n; ++i) out[i] += (x[i] * t.x + y[i] * t.y) + z[i] * t.z;
}

// The same of four forces, whose sum alone is float32: its error is far below that of C.
PALPATE_CLONES void add(const Triple* t, std::size_t ld, std::size_t n, double* __restrict out) noexcept {
  const Triple a = t[0], b = t[1], c = t[2], d = t[3];
  const float *ax = a.rows, *ay = ax + ld, *az = ay + ld, *bx = b.rows, *by = bx + ld, *bz = by + ld;
  const float *cx = c.rows, *cy = cx + ld, *cz = cy + ld, *dx = d.rows, *dy = dx + ld, *dz = dy + ld;
  for (std::size_t i = 0; i < n; ++i)
    out[i] += static_cast<double>(
        (((ax[i] * a.x + ay[i] * a.y) + az[i] * a.z) + ((bx[i] * b.x + by[i] * b.y) + bz[i] * b.z)) +
        (((cx[i] * c.x + cy[i] * c.y) + cz[i] * c.z) + ((dx[i] * d.x + dy[i] * d.y) + dz[i] * d.z)));
}

// Rows of new slots are fetched so many at a time.
constexpr std::size_t at_once = 32;

}  // namespace

ContactBlock::ContactBlock(std::size_t capacity, std::size_t watched, std::size_t rows, std::size_t combined)
    : capacity_(capacity),
      watchable_(watched),
      first_watched_((capacity + combined + 15) / 16 * 16),
      plane_(first_watched_ + (watched + 15) / 16 * 16),
      values_(9 * (capacity + combined) * plane_),
      fetched_(9 * at_once * std::max(capacity, watched)),
      slot_of_row_(rows, -1),
      row_of_slot_(plane_, -1),
      wanted_(plane_, 0) {
  std::fill_n(values_.data(), values_.size(), 0.0f);  // touch every page now, not in the first ticks
}

Mat3 ContactBlock::between(Index i, Index j) const noexcept {
  Mat3 c;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      c(a, b) =
          static_cast<double>(row(i, a)[static_cast<std::size_t>(b) * plane_ + static_cast<std::size_t>(j)]);
  return c;
}

void ContactBlock::displace(std::span<const Index> loaded, std::span<const Vec3> forces, std::size_t first,
                            std::size_t count, double* u) const noexcept {
  if (count == 0) return;
  for (std::size_t k = 0; k < loaded.size(); k += 4) {
    std::array<Triple, 4> four;
    for (std::size_t l = 0; l < 4; ++l) {
      const bool there = k + l < loaded.size();
      const Vec3f f = there ? Vec3f(forces[k + l].cast<float>()) : Vec3f(Vec3f::Zero());
      four[l] = {row(loaded[there ? k + l : k], 0) + first, f[0], f[1], f[2]};
    }
    add(four.data(), 3 * plane_, count, u);
  }
}

Vec3 ContactBlock::displacement(Index slot, std::span<const Index> loaded,
                                std::span<const Vec3> forces) const noexcept {
  Vec3 u = Vec3::Zero();
  for (std::size_t b = 0; b < 3; ++b)
    displace(loaded, forces, b * plane_ + static_cast<std::size_t>(slot), 1, u.data() + b);
  return u;
}

Vec3 ContactBlock::displacement(const float* rows, std::span<const Vec3> forces) noexcept {
  const std::size_t n = forces.size();
  Vec3 u = Vec3::Zero();
  for (std::size_t b = 0; b < 3; ++b)
    for (std::size_t k = 0; k < n; k += 4) {
      float part[4] = {};
      for (std::size_t l = k; l < std::min(k + 4, n); ++l) {
        const float* c = rows + 3 * n * b + 3 * l;
        const Vec3f f = forces[l].cast<float>();
        part[l - k] = (c[0] * f[0] + c[1] * f[1]) + c[2] * f[2];
      }
      u[static_cast<int>(b)] += static_cast<double>((part[0] + part[1]) + (part[2] + part[3]));
    }
  return u;
}

void ContactBlock::displacements(std::span<const Index> loaded, std::span<const Vec3> forces, Index first,
                                 Index last, std::span<double> u) const noexcept {
  const auto begin = static_cast<std::size_t>(first), count = static_cast<std::size_t>(last - first);
  for (std::size_t b = 0; b < 3; ++b) {
    std::fill_n(u.data() + b * plane_ + begin, count, 0.0);
    displace(loaded, forces, b * plane_ + begin, count, u.data() + b * plane_ + begin);
  }
}

void ContactBlock::displacements(std::span<const Index> loaded, std::span<const Vec3> forces,
                                 std::span<double> u) const noexcept {
  displacements(loaded, forces, 0, static_cast<Index>(width()), u);
  displacements(loaded, forces, static_cast<Index>(first_watched_),
                static_cast<Index>(first_watched_ + (watched_ + 15) / 16 * 16), u);
}

void ContactBlock::add_displacements(Index loaded, const Vec3& force, std::span<float> u) const noexcept {
  const Vec3f f = force.cast<float>();
  for (std::size_t b = 0; b < 3; ++b)
    add({row(loaded, 0) + b * plane_, f[0], f[1], f[2]}, 3 * plane_, width(), u.data() + b * plane_);
}

void ContactBlock::move_column(std::size_t from, std::size_t to) noexcept {
  for (std::size_t r = 0; r < 9 * used_; ++r) values_[r * plane_ + to] = values_[r * plane_ + from];
  row_of_slot_[to] = row_of_slot_[from];
  slot_of_row_[static_cast<std::size_t>(row_of_slot_[to])] = static_cast<Index>(to);
}

// Keeps the wanted ones of the slots from first to last: the last ones move into the holes of the others.
// Returns where they end.
template <class Move>
std::size_t ContactBlock::keep_wanted(std::size_t first, std::size_t last, Move&& move) noexcept {
  for (std::size_t i = first; i < last; ++i) {
    Index& slot = slot_of_row_[static_cast<std::size_t>(row_of_slot_[i])];
    if (!wanted_[i] && slot == static_cast<Index>(i)) slot = -1;
  }
  for (std::size_t to = first; to < last; ++to) {
    if (wanted_[to]) continue;
    while (last > to + 1 && !wanted_[last - 1]) --last;
    if (--last > to) move(last, to);
  }
  return last;
}

void ContactBlock::drop_unwanted() noexcept {
  used_ = keep_wanted(0, used_, [&](std::size_t from, std::size_t to) {
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b)
        for (const auto& [first, count] :
             {std::pair(b * plane_, used_), std::pair(b * plane_ + first_watched_, watched_)})
          std::copy_n(values_of(from, a) + first, count, values_of(to, a) + first);
    move_column(from, to);
  });
}

void ContactBlock::drop_unwatched() noexcept {
  watched_ = keep_wanted(first_watched_, first_watched_ + watched_,
                         [&](std::size_t from, std::size_t to) { move_column(from, to); }) -
             first_watched_;
}

// The rows of some loadable slots, and their mirror image: C is symmetric.
void ContactBlock::fetch(const Compliance& compliance, std::size_t first, std::size_t last) noexcept {
  const auto rows_and_back = [&](std::size_t begin, std::size_t count, std::span<const Index> added) {
    const std::size_t ld = 3 * count;
    compliance.block(added, rows_of(begin, count), {fetched_.data(), 3 * added.size() * ld}, ld);
  };
  for (; first < last; first += at_once) {
    const std::size_t count = std::min(at_once, last - first);
    const std::span<const Index> added = rows_of(first, count);
    for (const std::size_t begin : {std::size_t{0}, first_watched_}) {
      const std::size_t columns = begin == 0 ? used_ : watched_;
      if (columns == 0) continue;
      rows_and_back(begin, columns, added);
      for (std::size_t r = 0; r < 3 * count; ++r)
        for (std::size_t b = 0; b < 3; ++b) {
          float* to = values_.data() + (3 * first + r) * 3 * plane_ + b * plane_ + begin;
          for (std::size_t j = 0; j < columns; ++j) to[j] = fetched_[r * 3 * columns + 3 * j + b];
        }
    }
    for (std::size_t i = 0; i < used_; ++i)
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b)
          for (std::size_t j = first; j < first + count; ++j)
            values_of(i, a)[b * plane_ + j] = values_of(j, b)[a * plane_ + i];
  }
}

// The columns of some watched slots.
void ContactBlock::fetch_watched(const Compliance& compliance, std::size_t first, std::size_t last) noexcept {
  const std::size_t ld = 3 * used_;
  for (; first < last && used_ > 0; first += at_once) {
    const std::size_t count = std::min(at_once, last - first);
    compliance.block(rows_of(first, count), rows_of(0, used_), {fetched_.data(), 3 * count * ld}, ld);
    for (std::size_t i = 0; i < used_; ++i)
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b)
          for (std::size_t k = 0; k < count; ++k)
            values_of(i, a)[b * plane_ + first + k] = fetched_[(3 * k + b) * ld + 3 * i + a];
  }
}

Index ContactBlock::combine(const std::array<Index, 3>& slots, const Vec3& weights) noexcept {
  const std::size_t to = used(), columns[2][2] = {{0, to}, {first_watched_, watched_}};
  ++combined_;
  const auto mean = [&](std::size_t a, std::size_t first, std::size_t count, float* out) {
    std::fill_n(out, count, 0.0f);
    for (std::size_t k = 0; k < 3; ++k) {
      if (slots[k] < 0) continue;
      const auto weight = static_cast<float>(weights[static_cast<int>(k)]);
      const float* row = values_of(static_cast<std::size_t>(slots[k]), a) + first;
      for (std::size_t j = 0; j < count; ++j) out[j] += weight * row[j];
    }
  };
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b)
      for (const auto& [first, count] : columns)
        mean(a, b * plane_ + first, count, values_of(to, a) + b * plane_ + first);
  for (std::size_t i = 0; i < to; ++i)  // C is symmetric
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b) values_of(i, a)[b * plane_ + to] = values_of(to, b)[a * plane_ + i];
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b) mean(a, b * plane_ + to, 1, values_of(to, a) + b * plane_ + to);
  return static_cast<Index>(to);
}

void ContactBlock::require(const Compliance& compliance, std::span<const Index> rows,
                           std::span<const Index> watched, bool drop) noexcept {
  std::size_t missing = 0, present = 0, unseen = 0, seen = 0;
  combined_ = 0;
  std::fill(wanted_.begin(), wanted_.end(), std::uint8_t{0});
  const auto is_new = [&](Index slot) {
    return slot >= 0 && !std::exchange(wanted_[static_cast<std::size_t>(slot)], std::uint8_t{1});
  };
  for (const Index row : rows)
    if (is_loadable(slot_of(row)))
      present += is_new(slot_of(row));
    else
      ++missing;
  for (const Index row : watched) {
    const Index slot = slot_of(row);
    unseen += slot < 0;
    seen += slot >= 0 && !is_loadable(slot) && is_new(slot);
  }
  for (const Index row : rows)  // watched so far: its column is dropped with the next
    if (const Index slot = slot_of(row); slot >= 0 && !is_loadable(slot))
      wanted_[static_cast<std::size_t>(slot)] = 0, slot_of_row_[static_cast<std::size_t>(row)] = -1;
  // Every product of a solver runs over all slots: idle ones cost more than fetching them again.
  if (used_ + missing > capacity_ || (drop && used_ > present + present / 8 + 8)) drop_unwanted();
  if (watched_ + unseen > watchable_ || watched_ > seen + seen / 4 + 16) drop_unwatched();
  const std::size_t old = used_, old_watched = watched_;
  const auto put = [&](Index row, std::size_t slot) {
    slot_of_row_[static_cast<std::size_t>(row)] = static_cast<Index>(slot), row_of_slot_[slot] = row;
  };
  for (const Index row : rows)
    if (slot_of(row) < 0) put(row, used_++);
  if (used_ > old) fetch(compliance, old, used_);
  for (const Index row : watched)
    if (slot_of(row) < 0 && watched_ < watchable_) put(row, first_watched_ + watched_++);
  if (watched_ > old_watched)
    fetch_watched(compliance, first_watched_ + old_watched, first_watched_ + watched_);
}

}  // namespace palpate
