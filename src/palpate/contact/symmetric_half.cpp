#include "palpate/contact/symmetric_half.hpp"

#include <algorithm>

#include "palpate/base/clones.hpp"
#include "palpate/contact/lanes.hpp"

namespace palpate {

namespace {

// Eight block rows are a group; two of a group stand together: of these, for x, y, z of the columns and for
// each eight of them up to the group's own, a piece: x, y, z of the first row and x, y, z of the second.
constexpr std::size_t together = 2, part = 3 * lanes, piece = together * part;

std::size_t begin_of(std::size_t group) noexcept { return lanes / 2 * 9 * lanes * group * (group + 1); }

// Where row i's part begins of the piece of its columns' b, of the eight after j, which is in i's group or
// before.
std::size_t begin_of(std::size_t i, std::size_t j, std::size_t b) noexcept {
  const std::size_t group = i / lanes, pair = i % lanes / together;
  return begin_of(group) + ((pair * 3 + b) * (group + 1) + j / lanes) * piece + i % together * part;
}

// Eight rows at a time: A against the columns before these, both ways, their u by its force, and what theirs
// do to it; among the eight one way, as all of it is there. Two of them together, for what the registers
// hold.
PALPATE_CLONES void multiply(const float* v, std::size_t plane, std::size_t n, const float* f,
                             float* u) noexcept {
  for (std::size_t first = 0; first < n; first += lanes) {
    Lanes sums[3][lanes];
    for (std::size_t l = 0; l < lanes; l += together) {
      const std::size_t i = first + l;
      const float px = f[i], py = f[plane + i], pz = f[2 * plane + i];
      const float qx = f[i + 1], qy = f[plane + i + 1], qz = f[2 * plane + i + 1];
      Lanes p0 = {}, p1 = {}, p2 = {}, q0 = {}, q1 = {}, q2 = {};
      for (std::size_t b = 0; b < 3; ++b, v += piece) {
        const float* fb = f + b * plane;
        float* ub = u + b * plane;
        for (std::size_t k = 0; k < first; k += lanes, v += piece) {
          const Lanes force = at(fb + k), x = at(v), y = at(v + lanes), z = at(v + 2 * lanes);
          p0 += x * force, p1 += y * force, p2 += z * force;
          Lanes moved = (x * px + y * py) + z * pz;
          const Lanes qc = at(v + part), qd = at(v + part + lanes), qe = at(v + part + 2 * lanes);
          q0 += qc * force, q1 += qd * force, q2 += qe * force;
          moved += (qc * qx + qd * qy) + qe * qz;
          at(ub + k) += moved;
        }
        const Lanes force = at(fb + first);
        p0 += at(v) * force, p1 += at(v + lanes) * force, p2 += at(v + 2 * lanes) * force;
        q0 += at(v + part) * force, q1 += at(v + part + lanes) * force;
        q2 += at(v + part + 2 * lanes) * force;
      }
      sums[0][l] = p0, sums[1][l] = p1, sums[2][l] = p2;
      sums[0][l + 1] = q0, sums[1][l + 1] = q1, sums[2][l + 1] = q2;
    }
    for (std::size_t a = 0; a < 3; ++a) add_totals(sums[a], at(u + a * plane + first));
  }
}

}  // namespace

SymmetricHalf::SymmetricHalf(std::size_t capacity) : values_(begin_of((capacity + lanes - 1) / lanes)) {
  std::fill_n(values_.data(), values_.size(), 0.0f);  // touch every page now, not in the first product
}

void SymmetricHalf::set(std::size_t i, const float* rows, std::size_t plane, std::size_t n) noexcept {
  const std::size_t first = i / lanes * lanes;  // of its group
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b) {
      const float* row = rows + (3 * a + b) * plane;
      for (std::size_t j = 0; j <= first; j += lanes)
        std::copy_n(row + j, lanes, values_.data() + begin_of(i, j, b) + a * lanes);
    }
  for (std::size_t j = first; j < n; ++j)
    for (std::size_t b = 0; b < 3; ++b) {  // of the column, so x, y, z of i
      float* const to = values_.data() + begin_of(j, i, b) + i % lanes;
      for (std::size_t a = 0; a < 3; ++a) to[a * lanes] = rows[(3 * b + a) * plane + j];
    }
}

void SymmetricHalf::add_product(std::size_t n, std::size_t plane, std::span<const float> f,
                                std::span<float> u) const noexcept {
  multiply(values_.data(), plane, n, f.data(), u.data());
}

}  // namespace palpate
