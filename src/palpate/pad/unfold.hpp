// Surfaces that run through themselves at a few places, as scans and hand-made organs do, made fit to be
// padded.
#pragma once

#include <cstddef>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

struct Unfolded {
  std::size_t crossings = 0;  // edges through triangles, before
  std::size_t moved = 0;      // vertices
  double farthest = 0;        // that one was moved, m
};

// Smooths the surface where it runs through itself until it does not: vertices of the crossing triangles, and
// of a wider and wider neighbourhood where that does not help, go to the middle of their neighbours.
// Triangles stay as they are. Throws Error(geometry) when places are left after all rounds (parts that
// overlap widely must be united).
Unfolded unfold(TriangleMesh& mesh);

}  // namespace palpate
