// Better shaped tetrahedra without moving a surface.
#pragma once

#include "palpate/base/progress.hpp"
#include "palpate/pad/flips.hpp"

namespace palpate {

// Flips what is not protected and moves the nodes from `first_free` on, until all tetrahedra reach `goal`
// (shape, see flips.hpp) or nothing gets better any more.
void improve(FlipMesh& mesh, Index first_free, double goal, const Progress& progress = {});

// Flips away tetrahedra below `goal`, as far as single flips can. Moves nothing.
void flip_out(FlipMesh& mesh, double goal);

}  // namespace palpate
