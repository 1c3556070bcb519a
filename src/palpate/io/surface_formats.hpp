// The surface formats that are read in this process, from bytes. All throw Error(format) that names line,
// byte or element; `name` is the file's name in messages. Meshes come as in the file: file units, not welded.
#pragma once

#include <string>
#include <string_view>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

// Wavefront OBJ: v and f, positive and relative indices, polygons, continued lines; the rest is skipped.
TriangleMesh read_obj(std::string_view bytes, const std::string& name);

// STL, binary and text. Coordinates are float32 in both, three vertices a triangle.
TriangleMesh read_stl(std::string_view bytes, const std::string& name);
bool looks_like_stl(std::string_view bytes);

// PLY 1.0: text and binary of either byte order, any further elements and properties, polygons, triangle
// strips.
TriangleMesh read_ply(std::string_view bytes, const std::string& name);

// Error(format) when there are no triangles, or one with a vertex that is not there or not at a finite place.
void require_polygons(const TriangleMesh& mesh, const std::string& name, const std::string& format);

}  // namespace palpate
