// How far off a contact force may be, and why. Relative to the force's size.
#pragma once

#include "palpate/simulation/surface.hpp"

namespace palpate {

struct ErrorBar {
  // Of the elements, from the model's pinch, whose pressure many of them share; 0 where the model was baked
  // without (discretisation_known).
  double discretisation = 0;
  // Of a contact that few nodes share: 1.2 over their number. Measured on 3 nodes and more (ErrorBar.*); with
  // one or two it only says that the force means little.
  double resolution = 0;
  // Of the compliance as stored, were all its errors to push the same way.
  double compression = 0;
  // Of linear elasticity: what the linear strain neglects of the Green-Lagrange strain where it is loaded.
  double linearity = 0;
  bool discretisation_known = false;

  // The sum: each part has a direction of its own (elements are always too stiff, say), so they do not
  // cancel like independent noise.
  double total() const noexcept { return discretisation + resolution + compression + linearity; }
};

// Of the resultant of the surface's loads; all zero where there are none. Never throws, allocates nothing
// after a thread's first call.
ErrorBar error_bar(const Organ& organ, const Surface& surface) noexcept;
// Of the force on one node: linearity is the node's own, the rest that of the resultant. Where the node's row
// is not loaded, the resultant's. It is meant for the pressure around a node, not for its share of it.
ErrorBar error_bar(const ErrorBar& resultant, const Surface& surface, Index row) noexcept;

}  // namespace palpate
