// Whether a surface crosses or touches itself away from its own edges and corners: there pseudonormals do not
// tell inside from outside.
#pragma once

#include "palpate/geometry/bvh.hpp"

namespace palpate {

// An edge of one triangle against another with which it shares no corner, for all pairs. `bvh`
// is of the same mesh. Stops at the first.
bool crosses_itself(const TriangleMesh& mesh, const Bvh& bvh);

}  // namespace palpate
