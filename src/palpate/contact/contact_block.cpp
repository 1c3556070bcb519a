#include "palpate/contact/contact_block.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "palpate/base/clones.hpp"
#include "palpate/contact/lanes.hpp"

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

PALPATE_CLONES void multiply(const float* values, std::size_t plane, std::size_t slots, const float* f,
                             float* u) noexcept {
  static constexpr std::int32_t keep[2 * lanes] = {-1, -1, -1, -1, -1, -1, -1, -1};
  for (std::size_t i = 0; i < slots; ++i) {
    const float *rows = values + 9 * plane * i, own[3] = {f[i], f[plane + i], f[2 * plane + i]};
    Lanes sum[3] = {};
    for (std::size_t b = 0; b < 3; ++b) {
      const float *x = rows + b * plane, *y = x + 3 * plane, *z = y + 3 * plane, *fb = f + b * plane;
      float* ub = u + b * plane;
      // C against the slots before this one, both ways: their u by its force, and what theirs do to it.
      for (std::size_t k = 0; k < i; k += lanes) {
        Lanes cx = at(x + k), cy = at(y + k), cz = at(z + k);
        if (k + lanes > i) {  // not the slots after it
          const Mask mask = *reinterpret_cast<const LooseMask*>(keep + lanes - (i - k));
          cx = reinterpret_cast<Lanes>(reinterpret_cast<Mask>(cx) & mask);
          cy = reinterpret_cast<Lanes>(reinterpret_cast<Mask>(cy) & mask);
          cz = reinterpret_cast<Lanes>(reinterpret_cast<Mask>(cz) & mask);
        }
        const Lanes force = at(fb + k);
        at(ub + k) += (cx * own[0] + cy * own[1]) + cz * own[2];
        sum[0] += cx * force, sum[1] += cy * force, sum[2] += cz * force;
      }
    }
    for (std::size_t a = 0; a < 3; ++a) {
      const float* row = rows + 3 * a * plane + i;
      u[a * plane + i] += ((row[0] * own[0] + row[plane] * own[1]) + row[2 * plane] * own[2]) + total(sum[a]);
    }
  }
}

// Three rows of C times forces, in whole lanes.
PALPATE_CLONES void dot_rows(const float* rows, std::size_t plane, std::size_t slots, const float* f,
                             float* u) noexcept {
  Lanes sum[3] = {};
  for (std::size_t b = 0; b < 3; ++b) {
    const float *x = rows + b * plane, *y = x + 3 * plane, *z = y + 3 * plane, *fb = f + b * plane;
    for (std::size_t k = 0; k < slots; k += lanes) {
      const Lanes force = at(fb + k);
      sum[0] += at(x + k) * force;
      sum[1] += at(y + k) * force;
      sum[2] += at(z + k) * force;
    }
  }
  for (std::size_t a = 0; a < 3; ++a) u[a] = total(sum[a]);
}

// Rows of new slots are fetched so many at a time.
constexpr std::size_t at_once = 32;

constexpr std::size_t least_plane = 64;

}  // namespace

ContactBlock::ContactBlock(std::size_t capacity, std::size_t watched, std::size_t rows, std::size_t combined)
    : capacity_(capacity),
      watchable_(watched),
      first_watched_((capacity + combined + 15) / 16 * 16),
      plane_(std::min(first_watched_, least_plane)),
      values_(9 * (first_watched_ + watched) * first_watched_),
      fetched_(9 * at_once * std::max(capacity, watched)),
      slot_of_row_(rows, -1),
      row_of_slot_(first_watched_ + watched, -1),
      wanted_(first_watched_, 0) {
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

void ContactBlock::spread(std::span<const Index> loaded, std::span<const Vec3> forces,
                          std::span<float> planes) const noexcept {
  for (std::size_t b = 0; b < 3; ++b) {
    std::fill_n(planes.data() + b * plane_, nodes_width(), 0.0f);
    for (std::size_t k = 0; k < loaded.size(); ++k)
      planes[b * plane_ + static_cast<std::size_t>(loaded[k])] =
          static_cast<float>(forces[k][static_cast<int>(b)]);
  }
}

Vec3 ContactBlock::displacement(Index slot, std::span<const float> forces) const noexcept {
  float u[3];
  dot_rows(row(slot, 0), plane_, nodes_width(), forces.data(), u);
  return Vec3f(u[0], u[1], u[2]).cast<double>();
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

void ContactBlock::displacements(std::span<const Index> loaded, std::span<const Vec3> forces,
                                 std::span<double> u) const noexcept {
  for (std::size_t b = 0; b < 3; ++b) {
    double* to = u.data() + b * plane_;
    std::fill_n(to, width(), 0.0);
    for (std::size_t k = 0; k < loaded.size(); k += 4) {
      std::array<Triple, 4> four;
      for (std::size_t l = 0; l < 4; ++l) {
        const bool there = k + l < loaded.size();
        const Vec3f f = there ? Vec3f(forces[k + l].cast<float>()) : Vec3f(Vec3f::Zero());
        four[l] = {row(loaded[there ? k + l : k], 0) + b * plane_, f[0], f[1], f[2]};
      }
      add(four.data(), 3 * plane_, width(), to);
    }
  }
}

void ContactBlock::add_displacements(Index loaded, const Vec3& force, std::span<float> u) const noexcept {
  const Vec3f f = force.cast<float>();
  for (std::size_t b = 0; b < 3; ++b)
    add({row(loaded, 0) + b * plane_, f[0], f[1], f[2]}, 3 * plane_, width(), u.data() + b * plane_);
}

void ContactBlock::add_product(std::span<const float> f, std::span<float> u) const noexcept {
  multiply(values_.data(), plane_, used(), f.data(), u.data());
}

// Rows stand close, so that what a product reads is one stream; what is watched is fetched again when it is
// wanted.
void ContactBlock::widen(std::size_t plane) noexcept {
  for (std::size_t k = first_watched_; k < first_watched_ + watched_; ++k)
    if (Index& slot = slot_of_row_[static_cast<std::size_t>(row_of_slot_[k])]; slot == static_cast<Index>(k))
      slot = -1;
  watched_ = oldest_ = 0;
  const auto move = [&](std::size_t r) {
    std::memmove(values_.data() + r * plane, values_.data() + r * plane_, used_ * sizeof(float));
  };
  if (plane > plane_)
    for (std::size_t r = 9 * used_; r-- > 0;) move(r);
  else
    for (std::size_t r = 0; r < 9 * used_; ++r) move(r);
  plane_ = plane;
}

// A loadable slot's row and column.
void ContactBlock::move_slot(std::size_t from, std::size_t to) noexcept {
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b)
      std::copy_n(values_of(from, a) + b * plane_, used_, values_of(to, a) + b * plane_);
  for (const auto& [first, count] :
       {std::pair(std::size_t{0}, used_), std::pair(plane_, watched_)})  // places
    for (std::size_t r = 9 * first; r < 9 * (first + count); ++r)
      values_[r * plane_ + to] = values_[r * plane_ + from];
  row_of_slot_[to] = row_of_slot_[from];
  slot_of_row_[static_cast<std::size_t>(row_of_slot_[to])] = static_cast<Index>(to);
}

// The last loadable slots move into the holes of those that are not wanted.
void ContactBlock::drop_unwanted() noexcept {
  ++moves_;
  std::size_t last = used_;
  for (std::size_t i = 0; i < last; ++i)
    if (!wanted_[i]) slot_of_row_[static_cast<std::size_t>(row_of_slot_[i])] = -1;
  for (std::size_t to = 0; to < last; ++to) {
    if (wanted_[to]) continue;
    while (last > to + 1 && !wanted_[last - 1]) --last;
    if (--last > to) move_slot(last, to);
  }
  used_ = last;
}

// The rows of some loadable slots, and their mirror image: C is symmetric.
void ContactBlock::fetch(const Compliance& compliance, std::size_t first, std::size_t last) noexcept {
  for (; first < last; first += at_once) {
    const std::size_t count = std::min(at_once, last - first), end = first + count;
    const std::span<const Index> added = rows_of(first, count);
    const auto fetch_against = [&](std::size_t begin, std::size_t columns, auto&& put) {
      const std::size_t ld = 3 * columns;
      compliance.block(added, rows_of(begin, columns), {fetched_.data(), 3 * count * ld}, ld);
      for (std::size_t i = first; i < end; ++i)
        for (std::size_t a = 0; a < 3; ++a)
          for (std::size_t j = 0; j < columns; ++j)
            for (std::size_t b = 0; b < 3; ++b)
              put(i, a, begin + j, b, fetched_[(3 * (i - first) + a) * ld + 3 * j + b]);
    };
    fetch_against(0, end, [&](std::size_t i, std::size_t a, std::size_t j, std::size_t b, float c) {
      values_of(i, a)[b * plane_ + j] = c;
      if (j < first) values_of(j, b)[a * plane_ + i] = c;
    });
    if (watched_ > 0)
      fetch_against(first_watched_, watched_,
                    [&](std::size_t i, std::size_t a, std::size_t j, std::size_t b, float c) {
                      values_of(j, b)[a * plane_ + i] = c;
                    });
  }
}

Index ContactBlock::watch(const Compliance& compliance, Index watched) noexcept {
  if (watchable_ == 0) return -1;
  if (watched_ < watchable_) oldest_ = watched_++;
  const std::size_t slot = first_watched_ + oldest_;
  oldest_ = (oldest_ + 1) % watchable_;
  if (const Index before = std::exchange(row_of_slot_[slot], watched);
      before >= 0 && slot_of_row_[static_cast<std::size_t>(before)] == static_cast<Index>(slot))
    slot_of_row_[static_cast<std::size_t>(before)] = -1;
  slot_of_row_[static_cast<std::size_t>(watched)] = static_cast<Index>(slot);
  const std::size_t ld = 3 * used_;
  if (used_ > 0) compliance.block({&watched, 1}, rows_of(0, used_), {fetched_.data(), 3 * ld}, ld);
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t j = 0; j < used_; ++j)
      for (std::size_t b = 0; b < 3; ++b) values_of(slot, a)[b * plane_ + j] = fetched_[a * ld + 3 * j + b];
  return static_cast<Index>(slot);
}

Index ContactBlock::combine(const std::array<Index, 3>& slots, const Vec3& weights) noexcept {
  const std::size_t to = used();
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
    for (std::size_t b = 0; b < 3; ++b) mean(a, b * plane_, to, values_of(to, a) + b * plane_);
  for (std::size_t i = 0; i < to; ++i)  // C is symmetric
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b) values_of(i, a)[b * plane_ + to] = values_of(to, b)[a * plane_ + i];
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b) mean(a, b * plane_ + to, 1, values_of(to, a) + b * plane_ + to);
  return static_cast<Index>(to);
}

void ContactBlock::require(const Compliance& compliance, std::span<const Index> rows,
                           std::size_t combined) noexcept {
  std::size_t missing = 0, present = 0;
  combined_ = 0;
  std::fill(wanted_.begin(), wanted_.end(), std::uint8_t{0});
  for (const Index row : rows) {
    Index& slot = slot_of_row_[static_cast<std::size_t>(row)];
    if (!is_loadable(slot)) {
      slot = -1;  // watched so far
      ++missing;
    } else {
      present += !std::exchange(wanted_[static_cast<std::size_t>(slot)], std::uint8_t{1});
    }
  }
  // Every product of a solver runs over all slots: idle ones cost more than fetching them again.
  if (used_ + missing > capacity_ || used_ > present + present / 16 + 4) drop_unwanted();
  const std::size_t old = used_, need = used_ + missing + combined;
  if (need > plane_ || (plane_ > least_plane && need < plane_ / 3))
    widen(std::min(first_watched_, std::max(least_plane, (need + need / 4 + 15) / 16 * 16)));
  for (const Index row : rows)
    if (slot_of(row) < 0) {
      row_of_slot_[used_] = row;
      slot_of_row_[static_cast<std::size_t>(row)] = static_cast<Index>(used_++);
    }
  if (used_ > old) fetch(compliance, old, used_);
}

}  // namespace palpate
