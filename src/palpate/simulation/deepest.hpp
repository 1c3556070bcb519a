// Where an instrument reaches deepest into a triangle between nodes: places.cpp's search.
#pragma once

#include <algorithm>
#include <limits>

#include "palpate/simulation/tick_work.hpp"

namespace palpate {

constexpr double fine = 1e-4;     // of a triangle: how exactly the deepest point is found
constexpr double at_node = 0.95;  // beyond this weight of a corner the corner itself does
constexpr double most_fixed =
    0.8;  // weight of corners that cannot move: beyond it a place could hardly give way
constexpr double infinite = std::numeric_limits<double>::infinity();

// A triangle as an instrument sees it.
struct View {
  const Faces& faces;
  const PlacedShape& shape;
  const Sweep& sweep;
  std::size_t triangle, instrument;
  std::array<Vec3, 3> now = {}, before = {};  // of the corners, organ frame, m

  // Of the smallest parts that are looked at, a share of the triangle.
  double leaf() const noexcept {
    return std::clamp(3 * faces.thickness[instrument] / faces.faces[triangle].longest, 1.0 / 32, 0.5);
  }
  // Of a place there.
  Vec3 point(const std::array<Vec3, 3>& corners, const Vec3& w) const noexcept {
    return w[0] * corners[0] + w[1] * corners[1] + w[2] * corners[2] -
           faces.allowance(triangle, instrument, w) * faces.faces[triangle].normal;
  }
  Path path(const Vec3& w) const noexcept {
    return sweep.known ? path_from(shape, sweep.last * point(before, w)) : Path{};
  }
  Gap gap(const Vec3& w) const noexcept { return shape.gap(point(now, w)); }
  // Change of the depth with each of the weights, m.
  Vec3 rise(const Vec3& w, const Gap& g) const noexcept {
    const Vec3 normal = g.slope * g.normal;
    const Vec3 sink =
        faces.allowance_gradient(triangle, instrument, w) * normal.dot(faces.faces[triangle].normal);
    return sink - Vec3(normal.dot(now[0]), normal.dot(now[1]), normal.dot(now[2]));
  }
};

struct Deepest {
  Vec3 weights = Vec3::Zero();
  double depth = -infinite;
  double size = 0;  // of the sample it came from, share of the triangle; 0: none
};

// The deepest ones at each corner of a triangle and in its middle: an edge that lies across it may go in at
// both ends.
struct Samples {
  std::array<Deepest, 4> best;
  double bound = -infinite;  // nothing in the triangle is deeper
};

inline Vec3 inwards(const std::array<Vec3, 3>& corners) {
  return (corners[2] - corners[0]).cross(corners[1] - corners[0]).normalized();
}
// How far a point has come by its path, m; whether that led through the solid, or into it.
inline double way_of(const PlacedShape& shape, const Path& path, const Vec3& p) noexcept {
  return path.known ? (shape.own(p) - path.from).norm() : 0.0;
}
inline bool has_passed(const PlacedShape& shape, const Path& path, const Vec3& p) noexcept {
  return path.known && passes(*shape.shape, path.from, shape.own(p), 0);
}
// How far a point in the solid is from being out of it along a way, m; infinite: farther than `most`.
double way_out(const PlacedShape& shape, const Vec3& p, const Vec3& along, double most) noexcept;

// Of the ball about the middle of a triangle that holds what is between the triangle and its places, m.
double radius_of(const std::array<Vec3, 3>& corners) noexcept;
// Of samples in parts of size `leaf`, but for where nothing is deeper than `more`, m.
Samples sample(const View& view, double leaf, double more) noexcept;
// The deepest of what the instrument has passed through in this tick, by the samples' paths. One that would
// have come round it alone takes the triangle along: it is as deep as it is far from being out on the inner
// side.
Deepest sample_swept(const View& view, double leaf, double more) noexcept;
// From `best` uphill, until the steps, or what they gain, are of no account `within` m; it ends where `more`
// is out of reach.
void climb(const View& view, double more, double within, Deepest& best) noexcept;

}  // namespace palpate
