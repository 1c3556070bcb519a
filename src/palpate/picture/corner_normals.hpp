// Normals for drawing: smooth over curved parts, broken at sharp edges.
#pragma once

#include <span>
#include <vector>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

// Three unit normals a triangle: the mean, weighted by angle, of those triangles at the corner whose own
// normal is within `crease` degrees of this one's. Zero for a triangle without area.
std::vector<Vec3f> corner_normals(std::span<const Vec3> vertices, std::span<const Triangle> triangles,
                                  double crease);

}  // namespace palpate
