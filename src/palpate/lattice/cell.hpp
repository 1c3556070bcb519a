// What every kind of lattice does with a point: the cell that holds it, the interpolation of what was found
// there, and what is known beyond the grid.
#pragma once

#include "palpate/lattice/lattice.hpp"

namespace palpate {

// The cell that holds p and where in it, clamped to the grid; safe for any p, no number included.
struct Cell {
  std::array<std::int32_t, 3> at;  // its lowest point
  Vec3 t;                          // 0..1 along each axis
};
Cell cell_at(const Grid& grid, const Vec3& p) noexcept;

// Trilinear weights of a cell's corners, z fastest.
std::array<double, 8> trilinear(const Vec3& t) noexcept;

// The 27 grid points about the one nearest to p, and the quadratic B-spline with them as coefficients.
struct Spline {
  std::array<std::array<std::int32_t, 3>, 3> at;  // [axis][-1, 0, 1], the last one repeated beyond the grid
  Vec3 t;                                         // p from the middle one, -0.5..0.5 along each axis
  Spline(const Grid& grid, const Vec3& p) noexcept;
  // values: z fastest. The gradient is that of the spline.
  LatticeSample operator()(const std::array<double, 27>& values, double h) const noexcept;
};

// Outside the box, from the distance d at its nearest point and the distance s to it. The surface lies in the
// box, which is convex, so no point of it is nearer than sqrt(s^2 + exact^2). An interpolant exceeds the
// exact distance on the box by at most h/sqrt(2): taken off gradually, to be continuous.
double beyond(const Grid& grid, double d, double s) noexcept;
LatticeSample beyond(const Grid& grid, const Vec3& p, LatticeSample nearest) noexcept;

// The next of a sequence of numbers in 0..1, the same on every machine: SplitMix64 (Steele, Lea, Flood 2014).
double uniform(std::uint64_t& seed) noexcept;

}  // namespace palpate
