// Rigid shapes a soft surface can touch: a lattice, or an exact primitive (T 3.2.3's sphere among them). All
// in the shape's own frame.
#pragma once

#include <memory>
#include <variant>

#include "palpate/lattice/band_lattice.hpp"

namespace palpate {

struct Sphere {
  double radius;
};  // about the origin, m
struct Capsule {
  double radius, half_length;
};  // along z: the segment (0, 0, +-half_length) swept by a ball
struct Cuboid {
  Vec3 half;
};                    // |x| <= half
struct HalfSpace {};  // z <= 0 is solid
using Shape = std::variant<Sphere, Capsule, Cuboid, HalfSpace, std::shared_ptr<const Lattice>,
                           std::shared_ptr<const BandLattice>>;

// A lattice that is not there.
bool is_empty(const Shape& shape) noexcept;
// Whether a primitive's sizes are finite and above zero (a capsule's half length: not below); of a lattice
// that is so by construction.
bool has_size(const Shape& shape) noexcept;

struct Gap {
  double distance = 0;         // signed, m, negative inside
  Vec3 normal = Vec3::Zero();  // unit, outwards, continuous where the surface is smooth
  double slope =
      1;  // of the distance along the normal: less than 1 near edges narrower than a lattice's cell
};

double distance(const Shape& shape, const Vec3& p) noexcept;
Gap gap(const Shape& shape, const Vec3& p) noexcept;
// The same bits for many points, of a lattice several times faster.
void gaps(const Shape& shape, std::span<const Vec3> points, std::span<Gap> out) noexcept;
// distance() is no less, and takes longer.
double distance_bound(const Shape& shape, const Vec3& p) noexcept;
// Half the thickness of the thinnest part that is told apart, m: a way shorter than this goes through
// nothing. Of a lattice its spacing, infinite for a half-space.
double finest(const Shape& shape) noexcept;
// Below this distance() changes by no more than lipschitz times the way, and what jumps is not less, m;
// infinite: it does not jump.
double band(const Shape& shape) noexcept;
// Box about the solid, infinite for a half-space along x, y and -z.
Box bounding_box(const Shape& shape) noexcept;
// For drawing and for checks: triangles of a primitive (half-space: a square of 0.2 m).
TriangleMesh surface_of_primitive(const Shape& shape);

}  // namespace palpate
