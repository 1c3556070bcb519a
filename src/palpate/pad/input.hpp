// What every way of padding asks of its surfaces. All throw Error, `what` names the surface in the message.
#pragma once

#include <string>
#include <vector>

#include "palpate/pad/pad.hpp"

namespace palpate {

// Coordinates are numbers, triangles name vertices, each vertex is in a triangle.
void require_numbers(const TriangleMesh& mesh, const std::string& what);
// Closed, oriented, two triangles an edge, with a volume.
void require_closed(const TriangleMesh& mesh, const std::string& what);
// Of the regions: none empty or twice.
void require_names(const PadOptions& options, const std::vector<NamedSurface>& inner);

}  // namespace palpate
