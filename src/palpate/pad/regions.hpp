// Which tetrahedra lie inside a surface.
#pragma once

#include <span>
#include <vector>

#include "palpate/geometry/triangle_mesh.hpp"
#include "palpate/pad/flips.hpp"

namespace palpate {

// For each tetrahedron (dead ones too) whether it lies inside the closed surface of `triangles` (nodes of the
// mesh, counter-clockwise seen from outside; the same triangles as those of `surface`). Decided by the side
// of the triangles that are faces of the mesh, so that flat tetrahedra beside them get the right side; by
// winding number where triangles are missing.
std::vector<char> inside(const FlipMesh& mesh, std::span<const Triangle> triangles,
                         const TriangleMesh& surface);

}  // namespace palpate
