// Surfaces from and to files: .iv .wrl .obj .stl .glb .gltf .ply in; .obj .stl .ply out (.vtu: vtu.hpp).
#pragma once

#include <filesystem>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

struct SurfaceFile {
  TriangleMesh mesh;  // welded, m
  WeldReport weld;
  std::string format;  // "Open Inventor", "STL", ...
};

// Metres per unit of a name: "m", "cm", "mm", "um", "in", "ft". Error(usage) lists them.
double unit_in_metres(std::string_view unit);

// Reads any surface format, by content first and extension second, scales by `unit` (metres per file unit),
// welds. .iv, .obj, .stl, .glb go through the importer program (importer.hpp); PLY is read here. Throws
// Error(file) or Error(format): missing, empty, truncated, wrong format, NaN, index out of range, no
// triangles.
SurfaceFile read_surface(const std::filesystem::path& path, double unit = 1.0);

// By extension. Coordinates are divided by `unit`.
void write_surface(const std::filesystem::path& path, const TriangleMesh& mesh, double unit = 1.0);

}  // namespace palpate
