// What isosurface stuffing makes of one background tetrahedron, by the signs of its vertices: it is kept,
// cut, or dropped. Quadrilaterals on faces are divided so that the neighbour divides them alike. Labelle,
// Shewchuk, "Isosurface stuffing" (2007, section 3).
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "palpate/base/vec.hpp"

namespace palpate {

struct Cutter {
  std::function<int(Index)> sign;  // of a background node: 1 inside, 0 on the surface, -1 outside
  std::function<Index(Index, Index)>
      cut;  // the node where the surface cuts the edge between two of unlike sign
  // Of a face with a, b inside and c outside, whether its quadrilateral is divided from a (to the cut of bc)
  // instead of from b. Must not depend on the order of a and b but for its meaning.
  std::function<bool(Index a, Index b, Index c)> from_first;
  std::function<Vec3(Index)> position;  // of any node
};

// Appends the tetrahedra inside, positively oriented.
void fill(const Tetrahedron& t, const Cutter& cutter, std::vector<Tetrahedron>& out);

}  // namespace palpate
