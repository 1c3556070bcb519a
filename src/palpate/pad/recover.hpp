// Surface triangles as faces of the tetrahedra, by flips.
#pragma once

#include <span>

#include "palpate/pad/flips.hpp"

namespace palpate {

struct Recovery {
  std::size_t edges_absent = 0;   // of the surface, before
  std::size_t faces_absent = 0;   // after the edges were recovered
  std::size_t edges_missing = 0;  // after all
  std::size_t faces_missing = 0;
};

// Flips tetrahedra until the triangles are faces of them, as far as flips can; protects those that are. The
// nodes must be in general position.
Recovery recover(FlipMesh& mesh, std::span<const Triangle> triangles);

}  // namespace palpate
