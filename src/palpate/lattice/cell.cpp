#include "palpate/lattice/cell.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {

Cell cell_at(const Grid& grid, const Vec3& p) noexcept {
  Cell c{};
  for (std::size_t a = 0; a < 3; ++a) {
    const int k = static_cast<int>(a), last = grid.n[a] - 1;
    const double x = (p[k] - grid.origin[k]) / grid.h;
    const double inside = x > 0 ? std::min(x, static_cast<double>(last)) : 0;  // 0 where p is no number
    c.at[a] = std::min(static_cast<int>(inside), last - 1);
    c.t[k] = inside - c.at[a];
  }
  return c;
}

std::array<double, 8> trilinear(const Vec3& t) noexcept {
  const std::array<double, 2> x{1 - t.x(), t.x()}, y{1 - t.y(), t.y()}, z{1 - t.z(), t.z()};
  std::array<double, 8> weight;
  for (std::size_t m = 0; m < 8; ++m) weight[m] = x[m >> 2] * y[m >> 1 & 1] * z[m & 1];
  return weight;
}

Spline::Spline(const Grid& grid, const Vec3& p) noexcept {
  const Box box = grid.box();
  const Vec3 x = (p.cwiseMax(box.min).cwiseMin(box.max) - grid.origin) / grid.h;
  for (std::size_t a = 0; a < 3; ++a) {
    const int k = static_cast<int>(a), last = grid.n[a] - 1;
    const int nearest =
        x[k] > 0 ? std::min(static_cast<int>(x[k] + 0.5), last) : 0;  // 0 where p is no number
    for (int i = 0; i < 3; ++i) at[a][static_cast<std::size_t>(i)] = std::clamp(nearest + i - 1, 0, last);
    t[k] = x[k] - nearest;
  }
}

LatticeSample Spline::operator()(const std::array<double, 27>& values, double h) const noexcept {
  std::array<std::array<double, 3>, 3> w, dw;  // weights and their derivatives
  for (std::size_t a = 0; a < 3; ++a) {
    const double x = t[static_cast<int>(a)];
    w[a] = {0.5 * (0.5 - x) * (0.5 - x), 0.75 - x * x, 0.5 * (0.5 + x) * (0.5 + x)};
    dw[a] = {x - 0.5, -2 * x, x + 0.5};
  }
  double d = 0;
  Vec3 g = Vec3::Zero();
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const double* row = values.data() + 9 * i + 3 * j;
      const double along = w[2][0] * row[0] + w[2][1] * row[1] + w[2][2] * row[2],
                   slope = dw[2][0] * row[0] + dw[2][1] * row[1] + dw[2][2] * row[2];
      d += w[0][i] * w[1][j] * along;
      g += Vec3(dw[0][i] * w[1][j] * along, w[0][i] * dw[1][j] * along, w[0][i] * w[1][j] * slope);
    }
  return {d, g / h};
}

double beyond(const Grid& grid, double d, double s) noexcept {
  if (!(d > 0)) return s + d;
  if (!(s < std::numeric_limits<double>::infinity())) return s;
  return std::max(s, std::sqrt(s * s + d * d) - std::min(s, std::sqrt(0.5) * grid.h));
}

LatticeSample beyond(const Grid& grid, const Vec3& p, LatticeSample nearest) noexcept {
  const Box box = grid.box();
  const Vec3 out = p - p.cwiseMax(box.min).cwiseMin(box.max);
  const double s = out.norm();
  // The gradient of sqrt(s^2 + d^2), times it.
  const Vec3 away = out + std::max(nearest.distance, 0.0) * nearest.gradient;
  if (away.norm() > 0 && s < std::numeric_limits<double>::infinity()) nearest.gradient = away.normalized();
  return {beyond(grid, nearest.distance, s), nearest.gradient};
}

double uniform(std::uint64_t& seed) noexcept {
  std::uint64_t x = seed += 0x9e3779b97f4a7c15u;
  x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
  x = (x ^ x >> 27) * 0x94d049bb133111ebu;
  return static_cast<double>((x ^ x >> 31) >> 11) * 0x1p-53;
}

}  // namespace palpate
