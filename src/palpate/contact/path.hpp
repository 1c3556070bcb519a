// The gap by the way a point came. A distance field alone pushes a point in a thin body out on the side that
// is nearer, which need not be the side it came from, and does not see a point that passed through wholly
// between two ticks (T 7.2 point 3). Here the point leaves a proxy where it first met the surface; the proxy
// follows the point over the surface, round edges too, and the gap is measured from it. Zilles, Salisbury, "A
// constraint-based god-object method for haptic display" (1995); Ortega, Redon, Coquillart, "A six
// degree-of-freedom god-object method for haptic display of rigid bodies" (2007).
#pragma once

#include "palpate/contact/clusters.hpp"

namespace palpate {

// Where a point was at the end of the last tick, in the shape's frame: outside or on its surface.
struct Path {
  Vec3 from = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  // there
  double distance = 0;         // there, m
  bool known = false;          // otherwise the gap is that of the place alone
};

// The distance grows along a way by no more than its length; an interpolated one by hardly more.
constexpr double lipschitz = 1.05;

// To be outside, `from` may lie in the solid by this share of finest(shape): what a tick that did not
// converge leaves.
constexpr double hardly_inside = 0.25;
Path path_from(const PlacedShape& shape, const Vec3& from) noexcept;

// From p (organ frame) to the shape, reached along the straight way from path.from. Equal to shape.gap(p)
// where that points to the side p came from. gone: the path when p has gone there, from p itself or if that
// is inside from its proxy.
Gap gap_by_path(const PlacedShape& shape, const Path& path, const Vec3& p, Path* gone = nullptr) noexcept;
// The same where the plain gap at `own`, p in the shape's frame, is known.
Gap gap_by_path(const PlacedShape& shape, const Path& path, const Vec3& own, Gap plain,
                Path* gone = nullptr) noexcept;

// Whether the straight way from a to b (shape frame) may come nearer to the shape than `clearance`.
bool passes(const Shape& shape, const Vec3& a, const Vec3& b, double clearance) noexcept;

}  // namespace palpate
