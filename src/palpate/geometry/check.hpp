// What a surface is worth: closed, oriented, manifold, how many parts (`palpate info`).
#pragma once

#include <cstddef>
#include <vector>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

struct MeshReport {
  std::size_t vertices = 0, triangles = 0;
  Box box;                              // m
  std::size_t components = 0;           // connected by shared vertices
  std::size_t open_edges = 0;           // edges of one triangle
  std::size_t nonmanifold_edges = 0;    // edges of three triangles or more
  std::size_t flipped_edges = 0;        // edges of two triangles that run through it in the same direction
  std::size_t duplicate_triangles = 0;  // triangles on the same three vertices as an earlier one
  double area = 0;                      // m2
  double volume = 0;                    // m3, signed
  Vec3 area_sum = Vec3::Zero();         // m2, sum of all area vectors: zero for a closed surface (the thesis'
                                        // hedgehog theorem, T 5.1.1)

  bool closed() const { return triangles > 0 && open_edges == 0 && nonmanifold_edges == 0; }
  bool oriented() const { return flipped_edges == 0; }
};
MeshReport check(const TriangleMesh& mesh);

// Number of the connected part (by shared vertices) of each triangle, counted from 0 in the order of
// triangles.
std::vector<Index> components(const TriangleMesh& mesh);
// Drops triangles on the same three vertices as an earlier one, whatever their orientation; returns how many.
std::size_t drop_duplicates(TriangleMesh& mesh);

}  // namespace palpate
