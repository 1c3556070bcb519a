// Tetrahedral meshes from and to files: .msh (Gmsh 1, 2.2 and 4.1, ascii and binary), MEDIT .mesh, .vtk
// (legacy, ascii and binary), .vtu, TetGen (.node + .ele). Regions come from physical groups, references,
// attributes or a cell array "region".
#pragma once

#include <filesystem>

#include "palpate/geometry/tet_mesh.hpp"

namespace palpate {

struct TetFile {
  TetMesh mesh;                 // m, positively oriented unless `inverted` counts otherwise
  std::string format;           // "Gmsh 4.1 binary", ...
  std::size_t inverted = 0;     // tetrahedra of the file with negative volume, left as they are
  std::size_t other_cells = 0;  // cells that are not tetrahedra, left out
};

// True when the file looks like one of the above (by content, then extension), so that a program knows which
// reader to call.
bool is_tet_file(const std::filesystem::path& path);
// Throws Error(file) or Error(format) that names line or byte and element.
TetFile read_tets(const std::filesystem::path& path, double unit = 1.0);
// By extension: .msh (Gmsh 2.2 ascii), .mesh, .vtk, .vtu, .node (and .ele beside it).
void write_tets(const std::filesystem::path& path, const TetMesh& mesh, double unit = 1.0);

}  // namespace palpate
