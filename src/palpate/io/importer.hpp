// Coin and Assimp live in a program of their own, palpate-import: they die on some damaged files. It is
// started for one file with limits on CPU time and memory, and sends triangles through a pipe; its death is a
// named error.
#pragma once

#include <filesystem>
#include <string>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

struct Imported {
  TriangleMesh mesh;   // as in the file, unwelded, file units
  std::string format;  // "Open Inventor", "STL", "Wavefront OBJ", "glTF"
};

// Looks for palpate-import beside the running program, then in $PALPATE_IMPORT, then in PATH.
Imported import_surface(const std::filesystem::path& path);

}  // namespace palpate
