// Triangles that run through each other.
#pragma once

#include <span>
#include <vector>

#include "palpate/base/vec.hpp"

namespace palpate {

struct Crossing {
  Index edge_of, through;  // triangles: an edge of the first pierces the second
  Vec3 at;                 // about where, m
};

// All pairs in which an edge of one triangle pierces another one that shares no corner with it. Touching is
// no crossing. At most `limit` are found.
std::vector<Crossing> crossings(std::span<const Vec3> vertices, std::span<const Triangle> triangles,
                                std::size_t limit);

}  // namespace palpate
