// Hermite interpolation of distances and their exact gradients in a cell: the trilinear interpolant, and
// along each of its edges what the cubic through both ends' slopes adds to the line, blended across
// bilinearly: the 32-parameter brick of Adini & Clough (1960). Exact for polynomials of degree three, so of
// fourth order where the distance is smooth.
#include <algorithm>
#include <cmath>

#include "palpate/lattice/lattice.hpp"

namespace palpate {

namespace {

// Slopes along an edge that differ by more belong to opposite sides of the medial axis or of a sharp edge.
constexpr double kink = 0.5;

struct Weights {
  double value[2], slope[2];  // of the line's ends; derivatives: -1, 1
  explicit Weights(double t) : value{1 - t, t}, slope{-1, 1} {}
};

// What the cubic through the ends' slopes adds to the line at t, and its derivative. In units of h.
struct Bend {
  double at, slope;
};
Bend bend(double t, double from, double to, double line) {
  if (std::abs(to - from) > kink) return {0, 0};
  const double a = from - line, b = to - line, u = 1 - t;
  return {t * u * (u * a - t * b), u * (1 - 3 * t) * a - t * (2 - 3 * t) * b};
}

}  // namespace

LatticeSample Lattice::hermite(const Vec3& p) const noexcept {
  const Box box = grid_.box();
  const Vec3 inside = p.cwiseMax(box.min).cwiseMin(box.max);
  std::array<int, 3> cell;
  std::array<double, 3> t;
  for (std::size_t a = 0; a < 3; ++a) {
    const int k = static_cast<int>(a);
    const double x = (inside[k] - grid_.origin[k]) / grid_.h;
    cell[a] = x > 0 ? std::min(static_cast<int>(x), grid_.n[a] - 2) : 0;  // 0 where p is no number
    t[a] = x - cell[a];
  }
  const std::array<Weights, 3> w{Weights(t[0]), Weights(t[1]), Weights(t[2])};
  const std::size_t first = grid_.number(cell);
  const std::array<std::size_t, 3> stride{
      static_cast<std::size_t>(grid_.n[1]) * static_cast<std::size_t>(grid_.n[2]),
      static_cast<std::size_t>(grid_.n[2]), 1};
  double f[8], g[3][8];  // in units of h; corner 4 i + 2 j + k
  for (std::size_t m = 0; m < 8; ++m) {
    const std::size_t at = first + (m >> 2) * stride[0] + (m >> 1 & 1) * stride[1] + (m & 1);
    f[m] = static_cast<double>(distance_[at]) / grid_.h;
    for (std::size_t a = 0; a < 3; ++a) g[a][m] = static_cast<double>(gradient_[at][static_cast<int>(a)]);
  }
  double d = 0;
  Vec3 slope = Vec3::Zero();
  for (std::size_t a = 0; a < 3; ++a) {
    const std::size_t b = (a + 1) % 3, c = (a + 2) % 3, step = std::size_t{4} >> a;
    for (std::size_t i = 0; i < 2; ++i)
      for (std::size_t j = 0; j < 2; ++j) {
        const std::size_t m = i * (std::size_t{4} >> b) + j * (std::size_t{4} >> c), n = m + step;
        const double line = f[n] - f[m], wb = w[b].value[i], wc = w[c].value[j];
        const Bend e = bend(t[a], g[a][m], g[a][n], line);
        d += wb * wc * e.at;
        if (a == 0) d += wb * wc * (f[m] + t[a] * line);
        slope[static_cast<int>(a)] += wb * wc * (line + e.slope);
        slope[static_cast<int>(b)] += w[b].slope[i] * wc * e.at;
        slope[static_cast<int>(c)] += wb * w[c].slope[j] * e.at;
      }
  }
  d *= grid_.h;
  if (box.contains(p)) return {d, slope};
  const Vec3 out = p - inside;
  const double away = out.norm();
  const Vec3 direction = out + std::max(d, 0.0) * slope;
  if (direction.norm() > 0 && away < std::numeric_limits<double>::infinity()) slope = direction.normalized();
  return {beyond(d, away), slope};
}

}  // namespace palpate
