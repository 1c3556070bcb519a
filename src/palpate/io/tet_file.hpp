// Tetrahedral meshes from and to files: .msh (Gmsh 1, 2.x and 4.1, text and binary), MEDIT .mesh and .meshb,
// .vtk (legacy, text and binary), .vtu, TetGen (.node + .ele). Regions come from physical groups, references,
// attributes or a cell array "region"; those in no tetrahedron are dropped. docs/formats.md says what is lost
// in which format.
#pragma once

#include <filesystem>

#include "palpate/geometry/tet_mesh.hpp"

namespace palpate {

struct TetFile {
  TetMesh mesh;                  // m, positively oriented unless `inverted` counts otherwise
  std::string format;            // "Gmsh 4.1 binary", ...
  std::size_t inverted = 0;      // tetrahedra of the file with negative volume, left as they are
  std::size_t higher_order = 0;  // tetrahedra of ten nodes or more, of which the four corners were taken
  std::size_t other_cells = 0;   // cells that are not tetrahedra, left out
  std::size_t unused_nodes = 0;  // nodes in no tetrahedron, left out
  // Cell arrays of .vtu and .vtk: "young" (Pa), "poisson", "density" (kg/m3), one a tetrahedron; empty where
  // the file has none. The unit of length does not change them.
  std::vector<double> young, poisson, density;
};

// True when the file looks like one of the above (by content, then extension), so that a program knows which
// reader to call.
bool is_tet_file(const std::filesystem::path& path);
// Throws Error(file) or Error(format) that names line or byte and element. TetGen: either of the two files.
TetFile read_tets(const std::filesystem::path& path, double unit = 1.0);
// By extension: .msh (Gmsh 2.2 text), .mesh, .vtk (text), .vtu, .node (and .ele beside it). Reading it back
// gives the same nodes, tetrahedra and regions, bit for bit where `unit` is 1.
void write_tets(const std::filesystem::path& path, const TetMesh& mesh, double unit = 1.0);

}  // namespace palpate
