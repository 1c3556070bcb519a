// The deepest point of a triangle in an instrument: by halving the triangle where the distance allows for
// one, then a compass search (Kolda, Lewis, Torczon, "Optimization by direct search", 2003) along the edges
// that rise.
#include "palpate/simulation/deepest.hpp"

#include <cmath>

namespace palpate {

namespace {

using Cell = std::array<Vec3, 3>;  // barycentric coordinates of its corners

// Calls at(middle, share) for parts of the triangle of size `leaf`, a share of it, that may hold what is
// looked for: may(middle, share) says of larger ones.
template <class May, class At>
void divide(const Cell& cell, double share, double leaf, const May& may, const At& at) noexcept {
  const Vec3 middle = (cell[0] + cell[1] + cell[2]) / 3;
  if (!may(middle, share)) return;
  if (share <= leaf) return at(middle, share);
  const Cell halves{(cell[1] + cell[2]) / 2, (cell[2] + cell[0]) / 2, (cell[0] + cell[1]) / 2};
  divide(halves, share / 2, leaf, may, at);
  for (std::size_t k = 0; k < 3; ++k)
    divide({cell[k], halves[(k + 1) % 3], halves[(k + 2) % 3]}, share / 2, leaf, may, at);
}
Cell whole() { return {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()}; }

}  // namespace

double way_out(const PlacedShape& shape, const Vec3& p, const Vec3& along, double most) noexcept {
  double out = 0, d = shape.distance(p);
  const auto go = [&] { d = shape.distance(p + (out += std::max(std::abs(d), 0.02 * most)) * along); };
  for (int k = 0; k < 40 && d >= 0 && out <= most; ++k) go();  // to the solid, from its other side
  double in = out;
  for (int k = 0; k < 40 && d < 0 && out <= most; ++k) in = out, go();
  if (d < 0 || out > most) return infinite;
  for (int i = 0; i < 20; ++i) {
    const double middle = (in + out) / 2;
    (shape.distance(p + middle * along) < 0 ? in : out) = middle;
  }
  return out;
}

double radius_of(const std::array<Vec3, 3>& corners) noexcept {
  const Vec3 middle = (corners[0] + corners[1] + corners[2]) / 3;
  double radius = 0;
  for (const Vec3& corner : corners) radius = std::max(radius, 1.1 * (corner - middle).norm());
  return radius;
}

Samples sample(const View& view, double leaf, double more) noexcept {
  Samples out;
  double depth = 0;
  const double radius = radius_of(view.now);
  const auto deeper = [&](double bound) {
    if (bound > more) return true;
    out.bound = std::max(out.bound, bound);
    return false;
  };
  divide(
      whole(), 1, leaf,
      [&](const Vec3& w, double share) {
        const Vec3 p = view.point(view.now, w);
        if (share == 1 && !deeper(radius - distance_bound(*view.shape.shape, view.shape.own(p))))
          return false;
        depth = -view.shape.distance(p);
        return deeper(depth + share * radius);
      },
      [&](const Vec3& w, double share) {
        out.bound = std::max(out.bound, depth + share * radius);
        int k = 0;
        Deepest& best = out.best[w.maxCoeff(&k) > 0.5 ? static_cast<std::size_t>(k) : 3];
        if (depth > best.depth) best = {w, depth, share};
      });
  return out;
}

Deepest sample_swept(const View& view, double leaf, double more) noexcept {
  Deepest best;
  const double radius = std::max(radius_of(view.now), radius_of(view.before));
  const Vec3 into = inwards(view.now);
  divide(
      whole(), 1, leaf,
      [&](const Vec3& w, double share) {
        return passes(*view.shape.shape, view.sweep.last * view.point(view.before, w),
                      view.shape.own(view.point(view.now, w)), share * radius);
      },
      [&](const Vec3& w, double share) {
        const Vec3 p = view.point(view.now, w);
        const Path path = view.path(w);
        double depth = -gap_by_path(view.shape, path, p).distance;
        if (depth < 0 && has_passed(view.shape, path, p)) {
          const double most = 2 * way_of(view.shape, path, p), out = way_out(view.shape, p, into, most);
          if (out <= most) depth = out;
        }
        if (depth > std::max(more, best.depth)) best = {w, depth, share};
      });
  return best;
}

namespace {

// Where a place may be: near a corner the corner itself does, near corners that cannot move nothing does.
Vec3 within_triangle(Vec3 w, const Vec3& fixed) noexcept {
  w = w.cwiseMax(0.0) / w.cwiseMax(0.0).sum();
  int k = 0;
  if (w.maxCoeff(&k) > at_node) {
    const double others = 1 - w[k];
    for (int l = 0; l < 3; ++l)
      if (l != k) w[l] = (1 - at_node) * (others > 1e-9 ? w[l] / others : 0.5);
    w[k] = at_node;
  }
  const Vec3 on_fixed = w.cwiseProduct(fixed), free = Vec3::Ones() - fixed;
  const double share = on_fixed.sum(), rest = 1 - share;
  if (share <= most_fixed) return w;
  const Vec3 others = rest > 1e-9 ? Vec3((w - on_fixed) / rest) : Vec3(free / free.sum());
  return most_fixed / share * on_fixed + (1 - most_fixed) * others;
}

}  // namespace

void climb(const View& view, double more, double within, Deepest& best) noexcept {
  const double longest = view.faces.faces[view.triangle].longest, least = std::max(fine, within / longest);
  const Vec3& fixed = view.faces.faces[view.triangle].fixed;
  best.weights = within_triangle(best.weights, fixed);
  Gap gap = view.gap(best.weights);
  Vec3 rise = view.rise(best.weights, gap);
  best.depth = -gap.distance;
  double step = 0.5 * best.size;
  for (int k = 0; k < 100 && step > least && best.depth + 2 * step * longest > more; ++k) {
    bool rose = false;
    const Vec3 slopes(std::abs(rise[0] - rise[1]), std::abs(rise[1] - rise[2]), std::abs(rise[2] - rise[0]));
    int first = 0, last = 0;
    slopes.maxCoeff(&first), slopes.minCoeff(&last);
    for (const int a : {first, last == first ? (first + 1) % 3 : 3 - first - last, last}) {
      if (slopes[a] * step < 0.1 * within) continue;
      const int b = (a + 1) % 3;
      const double sign = rise[a] > rise[b] ? 1 : -1;
      Vec3 w = best.weights;
      w[a] += sign * step, w[b] -= sign * step;
      w = within_triangle(w, fixed);
      if (w == best.weights) continue;
      gap = view.gap(w);
      if (!(-gap.distance > best.depth)) continue;
      best.weights = w, best.depth = -gap.distance, rise = view.rise(w, gap), rose = true;
      break;
    }
    if (!rose) step *= 0.3;
  }
}

}  // namespace palpate
