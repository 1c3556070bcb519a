#include "palpate/contact/symmetric_half.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "palpate/base/clones.hpp"
#include "palpate/contact/lanes.hpp"

namespace palpate {

namespace {

// Eight block rows are a group; two of a group stand together: of these, for x, y, z of the columns and for
// each eight of them up to the group's own, a piece: x, y, z of the first row and x, y, z of the second.
constexpr std::size_t together = 2, part = 3 * lanes, piece = together * part;

// The same in what it is stored as: floats, or pairs of them.
template <class T>
constexpr std::size_t size_of_piece = std::is_same_v<T, float> ? piece : part;

std::size_t begin_of(std::size_t group) noexcept { return lanes / 2 * 9 * lanes * group * (group + 1); }

// Where row i's part begins of the piece of its columns' b, of the eight after j, which is in i's group or
// before.
std::size_t begin_of(std::size_t i, std::size_t j, std::size_t b) noexcept {
  const std::size_t group = i / lanes, pair = i % lanes / together;
  return begin_of(group) + ((pair * 3 + b) * (group + 1) + j / lanes) * piece + i % together * part;
}

// Eight rows at a time: A against the columns before these, both ways, their u by its force, and what theirs
// do to it; among the eight one way, as all of it is there. Two of them together, for what the registers
// hold. take: from v on, x, y, z of eight columns of either row, and v to the next.
template <class T, class Take>
[[gnu::always_inline]] inline void multiply_half(const T* v, std::size_t plane, std::size_t n, const float* f,
                                                 float* u, const Take& take) noexcept {
  for (std::size_t first = 0; first < n; first += lanes) {
    Lanes sums[3][lanes];
    for (std::size_t l = 0; l < lanes; l += together) {
      const std::size_t i = first + l;
      const float px = f[i], py = f[plane + i], pz = f[2 * plane + i];
      const float qx = f[i + 1], qy = f[plane + i + 1], qz = f[2 * plane + i + 1];
      Lanes p0 = {}, p1 = {}, p2 = {}, q0 = {}, q1 = {}, q2 = {};
      for (std::size_t b = 0; b < 3; ++b) {
        const float* fb = f + b * plane;
        float* ub = u + b * plane;
        for (std::size_t k = 0; k <= first; k += lanes) {
          const Lanes force = at(fb + k);
          Lanes pc, pd, pe, qc, qd, qe;
          take(v, pc, pd, pe, qc, qd, qe);
          p0 += pc * force, p1 += pd * force, p2 += pe * force;
          q0 += qc * force, q1 += qd * force, q2 += qe * force;
          if (k < first) at(ub + k) += ((pc * px + pd * py) + pe * pz) + ((qc * qx + qd * qy) + qe * qz);
        }
      }
      sums[0][l] = p0, sums[1][l] = p1, sums[2][l] = p2;
      sums[0][l + 1] = q0, sums[1][l + 1] = q1, sums[2][l + 1] = q2;
    }
    for (std::size_t a = 0; a < 3; ++a) add_totals(sums[a], at(u + a * plane + first));
  }
}

[[gnu::always_inline]] inline void drop_sign(Lanes& x) noexcept { x = x < 0.0f ? -x : x; }

// The same rows against the columns up to their own eight, each block between its normals: out, and the sizes
// of each row, and of its part of each column before, added to sums. All `ld` apart.
template <class T, class Take>
[[gnu::always_inline]] inline void contract_half(const T* v, std::size_t n, const float* normals,
                                                 std::size_t ld, float* out, float* sums,
                                                 const Take& take) noexcept {
  for (std::size_t first = 0; first < n; first += lanes)
    for (std::size_t l = 0; l < lanes; l += together) {
      const std::size_t i = first + l, to_next = (first / lanes + 1) * size_of_piece<T>;
      const float px = normals[i], py = normals[ld + i], pz = normals[2 * ld + i];
      const float qx = normals[i + 1], qy = normals[ld + i + 1], qz = normals[2 * ld + i + 1];
      float *const to_p = out + i * ld, *const to_q = to_p + ld;
      Lanes size_p = {}, size_q = {};
      for (std::size_t k = 0; k <= first; k += lanes, v += size_of_piece<T>) {
        Lanes p = {}, q = {};
        for (std::size_t b = 0; b < 3; ++b) {
          const Lanes normal = at(normals + b * ld + k);
          Lanes pc, pd, pe, qc, qd, qe;
          const T* at_b = v + b * to_next;
          take(at_b, pc, pd, pe, qc, qd, qe);
          p += ((pc * px + pd * py) + pe * pz) * normal, q += ((qc * qx + qd * qy) + qe * qz) * normal;
        }
        at(to_p + k) = p, at(to_q + k) = q;
        drop_sign(p), drop_sign(q);
        size_p += p, size_q += q;
        if (k < first) at(sums + k) += p + q;
      }
      sums[i] += total(size_p), sums[i + 1] += total(size_q);
      v += 2 * to_next;
    }
}

[[gnu::always_inline]] inline void take_floats(const float*& v, Lanes& pc, Lanes& pd, Lanes& pe, Lanes& qc,
                                               Lanes& qd, Lanes& qe) noexcept {
  pc = at(v), pd = at(v + lanes), pe = at(v + 2 * lanes);
  qc = at(v + part), qd = at(v + part + lanes), qe = at(v + part + 2 * lanes);
  v += piece;
}

PALPATE_CLONES void multiply(const float* values, std::size_t plane, std::size_t n, const float* f,
                             float* u) noexcept {
  multiply_half(values, plane, n, f, u, take_floats);
}

PALPATE_CLONES void contract(const float* values, std::size_t n, const float* normals, std::size_t ld,
                             float* out, float* sums) noexcept {
  contract_half(values, n, normals, ld, out, sums, take_floats);
}

// A word is two numbers of 16 bits, 65536 times the first plus the second: as a whole it is the first, to the
// half step that the first was chosen by.
using Words [[gnu::vector_size(32), gnu::aligned(4), gnu::may_alias]] = std::int32_t;
inline const Words& at(const std::int32_t* p) noexcept { return *reinterpret_cast<const Words*>(p); }
inline Words& at(std::int32_t* p) noexcept { return *reinterpret_cast<Words*>(p); }

// What is less stays in the cache, where floats are as fast.
constexpr std::size_t worth_it = 200;
constexpr float most = 32767, second_one = 65536;

[[gnu::always_inline]] inline void unpack(const Words& pair, Lanes& first, Lanes& second) noexcept {
  first = __builtin_convertvector(pair, Lanes), second = __builtin_convertvector(pair << 16, Lanes);
}

// To the nearest whole number that fits.
[[gnu::always_inline]] inline void round(Lanes& x) noexcept {
  constexpr float shift = 12582912;  // beyond it float32 has no fractions
  x = x > most ? Lanes{} + most : x < -most ? Lanes{} - most : x;
  x = (x + shift) - shift;
}

// Eight columns of two rows' x, y, z. inverse: of the columns; p, q: of the rows' x, y, z.
PALPATE_CLONES void pack(const float* values, const float* inverse, const float* p, const float* q,
                         std::int32_t* pairs) noexcept {
  for (std::size_t a = 0; a < 3; ++a) {
    Lanes first = at(values + a * lanes) * at(inverse) * (p[a] * most);
    Lanes second = at(values + part + a * lanes) * at(inverse) * (q[a] * most);
    round(second);
    first -= second / second_one;
    round(first);
    at(pairs + a * lanes) =
        (__builtin_convertvector(first, Words) << 16) + __builtin_convertvector(second, Words);
  }
}

[[gnu::always_inline]] inline void take_pairs(const std::int32_t*& v, Lanes& pc, Lanes& pd, Lanes& pe,
                                              Lanes& qc, Lanes& qd, Lanes& qe) noexcept {
  unpack(at(v), pc, qc), unpack(at(v + lanes), pd, qd), unpack(at(v + 2 * lanes), pe, qe);
  v += part;
}

// The same from pairs.
PALPATE_CLONES void multiply_pairs(const std::int32_t* pairs, std::size_t plane, std::size_t n,
                                   const float* f, float* u) noexcept {
  multiply_half(pairs, plane, n, f, u, take_pairs);
}

PALPATE_CLONES void contract_pairs(const std::int32_t* pairs, std::size_t n, const float* normals,
                                   std::size_t ld, float* out, float* sums) noexcept {
  contract_half(pairs, n, normals, ld, out, sums, take_pairs);
}

}  // namespace

SymmetricHalf::SymmetricHalf(std::size_t capacity)
    : values_(begin_of((capacity + lanes - 1) / lanes)), pairs_(values_.size() / together), own_(capacity) {
  // Touch every page now, not in the first product.
  std::fill_n(values_.data(), values_.size(), 0.0f);
  std::fill_n(pairs_.data(), pairs_.size(), 0);
  for (auto* sizes : {&size_, &inverse_})
    for (std::vector<float>& axis : *sizes) axis.assign((capacity + lanes - 1) / lanes * lanes, 0.0f);
}

void SymmetricHalf::set(std::size_t i, const float* row, std::size_t n) noexcept {
  for (std::size_t a = 0; a < 3; ++a) {
    const float own = row[element_at(i, a, a)];
    size_[a][i] = own > 0 ? std::sqrt(own) : 0.0f;
    inverse_[a][i] = own > 0 ? 1 / size_[a][i] : 0.0f;
    for (std::size_t b = 0; b < 3; ++b) own_[i][3 * a + b] = row[element_at(i, a, b)];
  }
  const std::size_t first = i / lanes * lanes;  // of its group
  for (std::size_t j = 0; j <= first; j += lanes)
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b)
        std::copy_n(row + element_at(j, a, b), lanes, values_.data() + begin_of(i, j, b) + a * lanes);
  for (std::size_t j = first; j < n; ++j)
    for (std::size_t b = 0; b < 3; ++b) {  // of the column, so x, y, z of i
      float* const to = values_.data() + begin_of(j, i, b) + i % lanes;
      for (std::size_t a = 0; a < 3; ++a) to[a * lanes] = row[element_at(j, b, a)];
    }
  const auto pack_again = [&](std::size_t k, std::size_t column, std::size_t b) {
    const std::size_t p = k / together * together, begin = begin_of(p, column, b);
    const auto inverse = [&](std::size_t l) {
      return std::array{inverse_[0][l], inverse_[1][l], inverse_[2][l]};
    };
    pack(values_.data() + begin, inverse_[b].data() + column / lanes * lanes, inverse(p).data(),
         inverse(p + 1).data(), pairs_.data() + begin / together);
  };
  for (std::size_t b = 0; b < 3; ++b) {
    for (std::size_t j = 0; j <= first; j += lanes) pack_again(i, j, b);
    for (std::size_t j = first; j < n; j += together) pack_again(j, i, b);
  }
}

void SymmetricHalf::add_product(std::size_t n, std::size_t plane, std::span<const float> f,
                                std::span<float> u) const noexcept {
  multiply(values_.data(), plane, n, f.data(), u.data());
}

bool SymmetricHalf::add_rough_product(std::size_t n, std::size_t plane, std::span<const float> f, float off,
                                      std::span<float> u, std::span<float> work) const noexcept {
  if (n < worth_it) return false;
  float *const scaled = work.data(), *const moved = scaled + 3 * plane;
  const std::size_t end = (n + lanes - 1) / lanes * lanes;
  float squared = 0, largest = 0;
  for (std::size_t b = 0; b < 3; ++b) {
    for (std::size_t k = 0; k < n; ++k) {
      const float own = size_[b][k], x = scaled[b * plane + k] = f[b * plane + k] * own;
      squared += x * x, largest = std::max(largest, own);
    }
    std::fill_n(scaled + b * plane + n, end - n, 0.0f);
    std::fill_n(moved + b * plane, end, 0.0f);
  }
  constexpr float step = 1 / most, rms = 0.29f;  // of what is rounded, to a step
  if (!(rms * step * largest * std::sqrt(squared) <= off)) return false;
  multiply_pairs(pairs_.data(), plane, n, scaled, moved);
  for (std::size_t b = 0; b < 3; ++b)
    for (std::size_t k = 0; k < n; ++k)
      u[b * plane + k] += size_[b][k] * (step / second_one * moved[b * plane + k]);
  return true;
}

bool SymmetricHalf::along_normals(std::size_t n, std::span<const float> normals, std::size_t ld, bool rough,
                                  float* out, std::span<float> sums, std::span<float> work) const noexcept {
  const std::size_t end = (n + lanes - 1) / lanes * lanes;
  std::fill_n(sums.begin(), end, 0.0f);
  if (!rough || n < worth_it) {
    contract(values_.data(), n, normals.data(), ld, out, sums.data());
    return false;
  }
  const float unit = 1 / std::sqrt(most * second_one);
  for (std::size_t b = 0; b < 3; ++b)
    for (std::size_t k = 0; k < end; ++k) work[b * ld + k] = normals[b * ld + k] * (unit * size_[b][k]);
  contract_pairs(pairs_.data(), n, work.data(), ld, out, sums.data());
  return true;
}

}  // namespace palpate
