// Delaunay tetrahedra of points by Qhull.
#pragma once

#include <span>
#include <vector>

#include "palpate/base/vec.hpp"

namespace palpate {

// Tetrahedra of the convex hull of the points, positively oriented. Points in special position (five on a
// sphere) are moved a little, and are left where they were moved to: joggle them first, and it is next to
// nothing. Throws Error(geometry) when they span no volume, Error(resource) when Qhull runs out of memory.
std::vector<Tetrahedron> delaunay(std::span<Vec3> points);

// Moves each point by up to `amount` along each axis, the same way for the same number of points, so that no
// five are on a sphere any more.
void joggle(std::span<Vec3> points, double amount);

}  // namespace palpate
