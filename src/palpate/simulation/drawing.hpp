// A finer surface that is drawn in place of the organ's own and rides on it: what is drawn and what is
// computed are of independent sizes. Each vertex keeps its barycentric coordinates in the nearest triangle of
// the organ's surface and its height above it.
#pragma once

#include <span>
#include <vector>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

struct Drawing {
  TriangleMesh surface;               // at rest, m
  std::vector<Index> triangle;        // of the organ's surface, that each vertex rides on
  std::vector<Eigen::Vector4f> ride;  // of each vertex: barycentric coordinates, then the height in m
  // How far the drawn displacement is from the finite elements' own at the nearest point of the boundary, in
  // the pinch of discretisation.hpp, over the largest displacement; -1: not known.
  double error_rms = -1, error_max = -1;

  bool empty() const { return surface.vertices.empty(); }
};

// Throws Error(geometry) where `surface` is empty or lies farther from the organ's than a tenth of its size.
Drawing embed(TriangleMesh surface, const TriangleMesh& organ);

// Where the vertices are once the organ's surface nodes are at `nodes`. positions: one a vertex.
void draw(const Drawing& drawing, const TriangleMesh& organ, std::span<const Vec3> nodes,
          std::span<Vec3> positions) noexcept;

}  // namespace palpate
