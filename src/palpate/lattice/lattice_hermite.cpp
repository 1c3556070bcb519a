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

using Four = float __attribute__((vector_size(16)));  // the parallel edges of a cell

float sum(const Four& x) { return x[0] + x[1] + x[2] + x[3]; }

// The four edges along one axis, at t of it; u and v the places along the other two. In units of h.
struct Edges {
  Four from, to, slope_from, slope_to;
};
struct Part {
  float linear, bend, slope, slope_u,
      slope_v;  // slope: along the edges; slope_u, slope_v: the bend's across them
};
Part interpolate(const Edges& e, float t, float u, float v) {
  const Four wu{1 - u, 1 - u, u, u}, wv{1 - v, v, 1 - v, v}, up{-1, -1, 1, 1}, vp{-1, 1, -1, 1}, w = wu * wv;
  const Four line = e.to - e.from, jump = e.slope_to - e.slope_from, none{};
  const auto smooth = jump * jump <= static_cast<float>(kink * kink);
  const Four a = smooth ? e.slope_from - line : none, b = smooth ? e.slope_to - line : none;
  const float r = 1 - t;
  // What the cubic through the ends' slopes adds to the line, and its derivative.
  const Four bend = t * r * (r * a - t * b), slope = r * (1 - 3 * t) * a - t * (2 - 3 * t) * b;
  return {sum(w * (e.from + t * line)), sum(w * bend), sum(w * (line + slope)), sum(up * wv * bend),
          sum(wu * vp * bend)};
}

}  // namespace

LatticeSample Lattice::hermite(const Vec3& p) const noexcept {
  const Box box = grid_.box();
  const Vec3 inside = p.cwiseMax(box.min).cwiseMin(box.max);
  std::array<int, 3> cell;
  std::array<float, 3> t;
  for (std::size_t a = 0; a < 3; ++a) {
    const int k = static_cast<int>(a);
    const double x = (inside[k] - grid_.origin[k]) / grid_.h;
    cell[a] = x > 0 ? std::min(static_cast<int>(x), grid_.n[a] - 2) : 0;  // 0 where p is no number
    t[a] = static_cast<float>(x - cell[a]);
  }
  const std::size_t first = grid_.number(cell), row = static_cast<std::size_t>(grid_.n[2]),
                    sheet = row * static_cast<std::size_t>(grid_.n[1]);
  Four f[2], g[3][2];  // corner 4 i + 2 j + k
  const auto inverse = static_cast<float>(1 / grid_.h);
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t m = 0; m < 4; ++m) {
      const std::size_t at = first + i * sheet + (m >> 1) * row + (m & 1);
      f[i][m] = distance_[at] * inverse;
      for (std::size_t a = 0; a < 3; ++a) g[a][i][m] = gradient_[at][static_cast<int>(a)];
    }
  const auto pairs = [](const Four* x, auto low) {  // along y: the first or second two of each
    return low ? __builtin_shufflevector(x[0], x[1], 0, 1, 4, 5)
               : __builtin_shufflevector(x[0], x[1], 2, 3, 6, 7);
  };
  const auto ends = [](const Four* x, auto low) {  // along z: the even or odd ones
    return low ? __builtin_shufflevector(x[0], x[1], 0, 2, 4, 6)
               : __builtin_shufflevector(x[0], x[1], 1, 3, 5, 7);
  };
  const Part x = interpolate({f[0], f[1], g[0][0], g[0][1]}, t[0], t[1], t[2]);
  const Part y =
      interpolate({pairs(f, true), pairs(f, false), pairs(g[1], true), pairs(g[1], false)}, t[1], t[0], t[2]);
  const Part z =
      interpolate({ends(f, true), ends(f, false), ends(g[2], true), ends(g[2], false)}, t[2], t[0], t[1]);
  double d = static_cast<double>(x.linear + (x.bend + y.bend + z.bend));
  Vec3 slope =
      Vec3f(x.slope + y.slope_u + z.slope_u, x.slope_u + y.slope + z.slope_v, x.slope_v + y.slope_v + z.slope)
          .cast<double>();
  d *= grid_.h;
  if (box.contains(p)) return {d, slope};
  const Vec3 out = p - inside;
  const double away = out.norm();
  const Vec3 direction = out + std::max(d, 0.0) * slope;
  if (direction.norm() > 0 && away < std::numeric_limits<double>::infinity()) slope = direction.normalized();
  return {beyond(d, away), slope};
}

}  // namespace palpate
