// Surfaces of the project's own making, for the demo, the tests and the benchmarks. All closed, oriented
// outwards, metres.
#pragma once

#include <functional>

#include "palpate/geometry/tet_mesh.hpp"
#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

// Latitude-longitude sphere of `rings` x `segments` facets, poles on z.
TriangleMesh make_sphere(const Vec3& center, double radius, int rings, int segments);
// Torus about the y axis.
TriangleMesh make_torus(double major_radius, double minor_radius, int major_segments, int minor_segments);
// Box of triangles, each side divided into n x n squares.
TriangleMesh make_box(const Box& box, int n = 1);
// Subdivided icosahedron with vertices moved along the ray to radius(direction): star-shaped solids with even
// triangles.
TriangleMesh make_star_shaped(const Vec3& center, int frequency,
                              const std::function<double(const Vec3& direction)>& radius);

// A kidney-like solid, 0.12 m long (y), 0.06 wide (x), 0.05 deep (z), with the hilum at +x, of at least
// `vertices` vertices (the next 10 f^2 + 2, f >= 3): the unit sphere bent into a bean.
TriangleMesh make_kidney(int vertices);
// The stone in it: a lumpy solid of about 0.015 m in the lower half, 8 mm and more from the surface, of at
// least `vertices` vertices (the next 10 f^2 + 2).
TriangleMesh make_stone(int vertices);

// Regular tetrahedral block: n[0] x n[1] x n[2] cells of six (Kuhn) tetrahedra each, region "tissue".
TetMesh make_block(const Box& box, const std::array<int, 3>& cells);

}  // namespace palpate
