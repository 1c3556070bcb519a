#include "palpate/contact/contact_block.hpp"

#include <algorithm>
#include <utility>

#include "palpate/base/clones.hpp"
#include "palpate/contact/lanes.hpp"

namespace palpate {

namespace {

// From an element (a, b) of a row to (a + 1, b).
constexpr std::size_t along = element_at(0, 1);
static_assert(along == 3 * lanes && element_at(lanes) == 9 * lanes);

// A slot's row and the force on it.
struct Loaded {
  const float* row;
  float x, y, z;
};

// out += a force's part, each entry by itself, so its bits do not depend on where it stands.
PALPATE_CLONES void add(const Loaded& t, std::size_t slots, std::size_t plane,
                        float* __restrict out) noexcept {
  for (std::size_t k = 0; k < slots; k += lanes)
    for (std::size_t b = 0; b < 3; ++b) {
      const float* x = t.row + element_at(k, 0, b);
      float* to = out + b * plane + k;
      for (std::size_t l = 0; l < lanes; ++l)
        to[l] += (x[l] * t.x + x[l + along] * t.y) + x[l + 2 * along] * t.z;
    }
}

// The same of four forces, whose sum alone is float32: its error is far below that of C.
PALPATE_CLONES void add(const Loaded* t, std::size_t slots, std::size_t plane,
                        double* __restrict out) noexcept {
  const Loaded a = t[0], b = t[1], c = t[2], d = t[3];
  const auto part = [](const Loaded& l, std::size_t i) __attribute__((always_inline)) {
    return (l.row[i] * l.x + l.row[i + along] * l.y) + l.row[i + 2 * along] * l.z;
  };
  for (std::size_t k = 0; k < slots; k += lanes)
    for (std::size_t e = 0; e < 3; ++e) {
      const std::size_t first = element_at(k, 0, e);
      double* to = out + e * plane + k;
      for (std::size_t l = 0; l < lanes; ++l)
        to[l] += static_cast<double>((part(a, first + l) + part(b, first + l)) +
                                     (part(c, first + l) + part(d, first + l)));
    }
}

// A slot's row times forces, in whole lanes.
PALPATE_CLONES void dot_row(const float* row, std::size_t slots, const float* f, std::size_t plane,
                            float* u) noexcept {
  Lanes sx = {}, sy = {}, sz = {};
  for (std::size_t k = 0; k < slots; k += lanes)
    for (std::size_t b = 0; b < 3; ++b) {
      const float* c = row + element_at(k, 0, b);
      const Lanes force = at(f + b * plane + k);
      sx += at(c) * force, sy += at(c + along) * force, sz += at(c + 2 * along) * force;
    }
  u[0] = total(sx), u[1] = total(sy), u[2] = total(sz);
}

// The same of two loads, in the same bits.
PALPATE_CLONES void dot_row(const float* row, std::size_t slots, const float* f, const float* g,
                            std::size_t plane, float* u) noexcept {
  Lanes fx = {}, fy = {}, fz = {}, gx = {}, gy = {}, gz = {};
  for (std::size_t k = 0; k < slots; k += lanes)
    for (std::size_t b = 0; b < 3; ++b) {
      const float* c = row + element_at(k, 0, b);
      const Lanes one = at(f + b * plane + k), other = at(g + b * plane + k);
      const Lanes cx = at(c), cy = at(c + along), cz = at(c + 2 * along);
      fx += cx * one, fy += cy * one, fz += cz * one;
      gx += cx * other, gy += cy * other, gz += cz * other;
    }
  u[0] = total(fx), u[1] = total(fy), u[2] = total(fz);
  u[3] = total(gx), u[4] = total(gy), u[5] = total(gz);
}

// Rows of new slots are fetched so many at a time.
constexpr std::size_t at_once = 32;

// Up to one slot in so many that was filled since is found by itself; else all slots are looked at.
constexpr std::size_t hardly_any = 8;

// One slot in so many may stay idle while calls bring new rows.
constexpr std::size_t few_idle = 8;

}  // namespace

ContactBlock::ContactBlock(std::size_t capacity, std::size_t watched, std::size_t rows, std::size_t combined)
    : capacity_(capacity),
      watchable_(watched),
      // An odd number of sixteens: what stands at the same place of all rows shall not share a cache's sets.
      first_watched_((capacity + combined + 15) / 16 * 16 | 16),
      values_(9 * first_watched_ * (first_watched_ + watched)),
      half_(first_watched_),
      fetched_(9 * at_once * capacity),
      slot_of_row_(rows, -1),
      row_of_slot_(first_watched_ + watched, -1),
      wanted_(first_watched_, 0),
      filled_(first_watched_, 0),
      slot_of_fill_(first_watched_, -1),
      known_(watched),
      added_(capacity),
      since_(capacity),
      rows_(std::max(capacity, at_once)),
      taken_(capacity) {
  std::fill_n(values_.data(), values_.size(), 0.0f);  // touch every page now, not in the first ticks
}

Mat3 ContactBlock::between(Index i, Index j) const noexcept {
  Mat3 c;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      c(a, b) = static_cast<double>(row(i)[element_at(
          static_cast<std::size_t>(j), static_cast<std::size_t>(a), static_cast<std::size_t>(b))]);
  return c;
}

void ContactBlock::spread(std::span<const Index> loaded, std::span<const Vec3> forces,
                          std::span<float> planes) const noexcept {
  for (std::size_t b = 0; b < 3; ++b) {
    std::fill_n(planes.data() + b * plane(), width(), 0.0f);
    for (std::size_t k = 0; k < loaded.size(); ++k)
      planes[b * plane() + static_cast<std::size_t>(loaded[k])] =
          static_cast<float>(forces[k][static_cast<int>(b)]);
  }
}

Vec3 ContactBlock::displacement(Index slot, std::span<const float> forces) const noexcept {
  float u[3];
  dot_row(row(slot), width(), forces.data(), plane(), u);
  return Vec3f(u[0], u[1], u[2]).cast<double>();
}

std::array<Vec3, 2> ContactBlock::displacement(Index slot, std::span<const float> forces,
                                               std::span<const float> others) const noexcept {
  float u[6];
  dot_row(row(slot), width(), forces.data(), others.data(), plane(), u);
  return {Vec3f(u[0], u[1], u[2]).cast<double>(), Vec3f(u[3], u[4], u[5]).cast<double>()};
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
  for (std::size_t b = 0; b < 3; ++b) std::fill_n(u.data() + b * plane(), width(), 0.0);
  for (std::size_t k = 0; k < loaded.size(); k += 4) {
    std::array<Loaded, 4> four;
    for (std::size_t l = 0; l < 4; ++l) {
      const bool there = k + l < loaded.size();
      const Vec3f f = there ? Vec3f(forces[k + l].cast<float>()) : Vec3f(Vec3f::Zero());
      four[l] = {row(loaded[there ? k + l : k]), f[0], f[1], f[2]};
    }
    add(four.data(), width(), plane(), u.data());
  }
}

void ContactBlock::add_displacements(Index loaded, const Vec3& force, std::span<float> u) const noexcept {
  const Vec3f f = force.cast<float>();
  add({row(loaded), f[0], f[1], f[2]}, width(), plane(), u.data());
}

void ContactBlock::add_product(std::span<const float> f, std::span<float> u) const noexcept {
  half_.add_product(used(), plane(), f, u);
}

// Another row in a loadable slot.
void ContactBlock::fill(std::size_t slot, Index row) noexcept {
  row_of_slot_[slot] = row;
  slot_of_row_[static_cast<std::size_t>(row)] = static_cast<Index>(slot);
  filled_[slot] = ++fills_;
  slot_of_fill_[fills_ % slot_of_fill_.size()] = static_cast<Index>(slot);
}

// A loadable slot's row and column.
void ContactBlock::move_slot(std::size_t from, std::size_t to) noexcept {
  float* const row = row_of_values(to);
  std::copy_n(row_of_values(from), row_size(), row);
  for (std::size_t e = 0; e < 9; ++e) row[element_at(to) + e * lanes] = row[element_at(from) + e * lanes];
  row_is_made(to);
  wanted_[to] = wanted_[from];
  fill(to, row_of_slot_[from]);
}

// A slot for another row: a new one, or that of the row wanted longest ago.
Index ContactBlock::slot_for(std::size_t allowed) noexcept {
  if (used_ < allowed) return static_cast<Index>(used_++);
  const auto slot = std::min_element(wanted_.begin(), wanted_.begin() + static_cast<std::ptrdiff_t>(used_));
  const std::ptrdiff_t place = slot - wanted_.begin();
  slot_of_row_[static_cast<std::size_t>(row_of_slot_[static_cast<std::size_t>(place)])] = -1;
  return static_cast<Index>(place);
}

// The last loadable slots go while they are not wanted; one that is may move into the place of one that is
// not. That costs what a new slot does, so a call does it once.
void ContactBlock::shrink(std::size_t allowed, bool may_move) noexcept {
  while (used_ > allowed) {
    const std::size_t last = used_ - 1;
    if (wanted_[last] == calls_) {
      if (!std::exchange(may_move, false)) return;
      const auto gap = std::find_if(wanted_.begin(), wanted_.end(), [&](auto w) { return w != calls_; });
      const auto to = static_cast<std::size_t>(gap - wanted_.begin());
      slot_of_row_[static_cast<std::size_t>(row_of_slot_[to])] = -1;
      move_slot(last, to);
      ++moves_;
    } else {
      slot_of_row_[static_cast<std::size_t>(row_of_slot_[last])] = -1;
    }
    --used_;
  }
}

// The rows of some loadable slots.
void ContactBlock::fetch(const Compliance& compliance, std::span<const Index> slots) noexcept {
  for (std::size_t first = 0; first < slots.size(); first += at_once) {
    const std::span<const Index> some = slots.subspan(first, std::min(at_once, slots.size() - first));
    for (std::size_t k = 0; k < some.size(); ++k) rows_[k] = row_of_slot_[static_cast<std::size_t>(some[k])];
    const std::size_t ld = 3 * used_;
    compliance.block({rows_.data(), some.size()}, {row_of_slot_.data(), used_},
                     {fetched_.data(), 3 * some.size() * ld}, ld);
    for (std::size_t k = 0; k < some.size(); ++k) {
      const auto slot = static_cast<std::size_t>(some[k]);
      float* const row = row_of_values(slot);
      for (std::size_t j = 0; j < used_; ++j)
        for (std::size_t a = 0; a < 3; ++a)
          for (std::size_t b = 0; b < 3; ++b)
            row[element_at(j, a, b)] = fetched_[(3 * k + a) * ld + 3 * j + b];
      row_is_made(slot);
    }
  }
}

// A new one, or the next that has not been asked for since the last time round.
std::size_t ContactBlock::place_to_watch() noexcept {
  if (watched_ < watchable_) return watched_++;
  while (std::exchange(known_[next_].asked, false)) next_ = (next_ + 1) % watchable_;
  return std::exchange(next_, (next_ + 1) % watchable_);
}

Index ContactBlock::watch(const Compliance& compliance, Index watched) noexcept {
  if (watchable_ == 0) return -1;
  Index& own = slot_of_row_[static_cast<std::size_t>(watched)];
  const bool is_new = own < 0;
  if (is_new) {
    own = static_cast<Index>(first_watched_ + place_to_watch());
    const Index before = std::exchange(row_of_slot_[static_cast<std::size_t>(own)], watched);
    if (before >= 0 && before != watched && slot_of_row_[static_cast<std::size_t>(before)] == own)
      slot_of_row_[static_cast<std::size_t>(before)] = -1;
  }
  const auto slot = static_cast<std::size_t>(own);
  Known& known = known_[slot - first_watched_];
  known.asked = true;
  if (is_new) known.fills = 0;
  update_watched(compliance, slot);
  return own;
}

// Loadable slots filled since then, into since_, and their rows into rows_.
std::size_t ContactBlock::find_filled_since(std::uint64_t fills) noexcept {
  std::size_t n = 0;
  const auto add = [&](std::size_t slot) {
    since_[n] = static_cast<Index>(slot), rows_[n++] = row_of_slot_[slot];
  };
  if (fills_ - fills > used_ / hardly_any) {
    for (std::size_t k = 0; k < used_; ++k)
      if (filled_[k] > fills) add(k);
    return n;
  }
  while (fills++ < fills_) {
    const auto slot = static_cast<std::size_t>(slot_of_fill_[fills % slot_of_fill_.size()]);
    if (slot < used_ && filled_[slot] == fills) add(slot);  // else it was filled once more, or is gone
  }
  return n;
}

// What a watched row lacks of the slots filled since.
void ContactBlock::update_watched(const Compliance& compliance, std::size_t watched) noexcept {
  float* const row = row_of_values(watched);
  const std::size_t n = find_filled_since(std::exchange(known_[watched - first_watched_].fills, fills_));
  if (n == 0) return;
  compliance.block({&row_of_slot_[watched], 1}, {rows_.data(), n}, {fetched_.data(), 9 * n}, 3 * n);
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b)
        row[element_at(static_cast<std::size_t>(since_[j]), a, b)] = fetched_[3 * (a * n + j) + b];
}

// A new slot's row from the one that was watched, which is at hand: C's are far apart in memory.
void ContactBlock::take_watched(const Compliance& compliance, std::size_t watched,
                                std::size_t slot) noexcept {
  update_watched(compliance, watched);
  std::copy_n(row_of_values(watched), row_size(), row_of_values(slot));
  row_is_made(slot);
}

// The column to a slot's row: C is symmetric.
void ContactBlock::mirror(std::size_t slot, std::size_t rows) noexcept {
  const float* const row = row_of_values(slot);
  for (std::size_t j = 0; j < rows; ++j)
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b) row_of_values(j)[element_at(slot, b, a)] = row[element_at(j, a, b)];
}

// What follows from a loadable slot's row.
void ContactBlock::row_is_made(std::size_t slot) noexcept {
  mirror(slot, used_);
  half_.set(slot, row_of_values(slot), used_);
}

Index ContactBlock::combine(const std::array<Index, 3>& slots, const Vec3& weights) noexcept {
  const std::size_t to = used();
  ++combined_;
  float* const row = row_of_values(to);
  const auto mean = [&](std::size_t first, std::size_t count, std::size_t apart) {
    for (std::size_t e = first; e < first + count * apart; e += apart) {
      row[e] = 0;
      for (std::size_t k = 0; k < 3; ++k)
        if (slots[k] >= 0)
          row[e] += static_cast<float>(weights[static_cast<int>(k)]) *
                    row_of_values(static_cast<std::size_t>(slots[k]))[e];
    }
  };
  mean(0, row_size(), 1);
  mirror(to, to);
  mean(element_at(to), 9, lanes);
  half_.set(to, row, to + 1);
  return static_cast<Index>(to);
}

void ContactBlock::require(const Compliance& compliance, std::span<const Index> rows) noexcept {
  ++calls_;
  combined_ = 0;
  for (const Index row : rows)
    if (const Index slot = slot_of(row); is_loadable(slot)) wanted_[static_cast<std::size_t>(slot)] = calls_;
  // Every product of a solver runs over all slots: idle ones cost more than fetching them again.
  const std::size_t allowed = std::min(capacity_, rows.size() + rows.size() / 64 + 4);
  std::size_t added = 0, taken = 0;
  for (const Index row : rows) {
    const Index watched = slot_of(row);
    if (is_loadable(watched)) continue;
    const Index slot = slot_for(allowed);
    wanted_[static_cast<std::size_t>(slot)] = calls_;
    fill(static_cast<std::size_t>(slot), row);
    if (watched >= 0 && compliance.mirrors_bits())
      taken_[taken++] = {watched, slot};
    else
      added_[added++] = slot;
  }
  fetch(compliance, {added_.data(), added});
  for (const auto& [watched, slot] : std::span(taken_).first(taken))
    take_watched(compliance, static_cast<std::size_t>(watched), static_cast<std::size_t>(slot));
  shrink(allowed, added + taken == 0 || used_ > allowed + allowed / few_idle);
}

}  // namespace palpate
