// Surfaces as indexed triangles, and the repairs every imported surface gets.
#pragma once

#include <cstddef>
#include <vector>

#include "palpate/base/vec.hpp"

namespace palpate {

struct TriangleMesh {
  std::vector<Vec3> vertices;       // m
  std::vector<Triangle> triangles;  // counter-clockwise seen from outside
};

struct WeldReport {
  std::size_t welded = 0;      // vertices merged into one at the same place
  std::size_t degenerate = 0;  // triangles dropped: two corners the same, or zero area
  std::size_t unused = 0;      // vertices dropped: no triangle uses them
};

// Merges vertices at bit-identical positions (-0 equals 0), drops degenerate triangles and unused vertices.
// Order of the remaining vertices and triangles is kept.
WeldReport weld(TriangleMesh& mesh);

// 0.5 (b-a)x(c-a): area times unit normal, m2.
Vec3 area_vector(const TriangleMesh& mesh, const Triangle& t);
// Enclosed volume by the divergence theorem, m3; negative when the triangles face inwards.
double volume(const TriangleMesh& mesh);
// A third of the area of its triangles for each vertex, m2.
std::vector<double> vertex_areas(const TriangleMesh& mesh);
// Unit normals, mean of the adjacent triangles weighted by angle.
std::vector<Vec3> vertex_normals(const TriangleMesh& mesh);
// b appended to a, vertices not welded.
void append(TriangleMesh& a, const TriangleMesh& b);

}  // namespace palpate
