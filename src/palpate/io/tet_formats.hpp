// Inside of tet_file.cpp: one reader a format, each leaving what the file says in a RawTets.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/geometry/tet_mesh.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate {

// A mesh as a file says it: its own numbers for nodes and regions, its own unit.
struct RawTets {
  std::string format;
  std::vector<Vec3> nodes;
  std::vector<std::int64_t> numbers;  // of each node; empty: first_number, first_number + 1, ...
  std::int64_t first_number = 0;
  std::vector<std::array<std::int64_t, 4>> tets;  // node numbers
  std::vector<double> tags;                       // of each tetrahedron's region; empty: no regions
  std::map<double, std::string> names;            // of tags
  std::array<std::vector<double>, 3> material;    // as in TetFile: E, nu, density
  std::size_t higher_order = 0, other_cells = 0;  // as in TetFile
};

// Cell arrays of VTK's formats that mean something here: one value a cell, or empty.
struct CellArrays {
  std::vector<double> regions;
  std::array<std::vector<double>, 3> material;
  // Where an array of this name is kept; null: it means nothing here, or was there before.
  std::vector<double>* of(std::string_view name);
};

RawTets read_gmsh(Scanner& in);
RawTets read_medit(Scanner& in);
RawTets read_medit_binary(Scanner& in);
RawTets read_vtk_legacy(Scanner& in);
RawTets read_vtu(const std::string& file, const std::string& bytes);
RawTets read_tetgen(Scanner& nodes, Scanner& elements);

// How VTK, legacy and XML, stores numbers.
struct NumberType {
  int size;   // bytes; 0: not known
  char kind;  // 's'igned, 'u'nsigned, 'f'loating
};
double decode_number(const char* from, NumberType type, bool swapped);
std::int64_t decode_integer(const char* from, NumberType type, bool swapped);  // type.kind is not 'f'

// Sorts VTK's cells: tetrahedra into raw, all others counted. Cell i has the corners
// connectivity[offsets[i]..offsets[i+1]). `first_node` is added to them. `fail` says what is wrong with a
// cell.
void take_vtk_cells(RawTets& raw, const std::vector<std::int64_t>& connectivity,
                    const std::vector<std::int64_t>& offsets, const std::vector<std::int64_t>& types,
                    const CellArrays& arrays, std::int64_t first_node, const Scanner& in);
// Names of VTK's regions 0, 1, ...
void take_vtk_names(RawTets& raw, const std::vector<std::string>& names);

// Numbers of regions to write so that a reader finds them in the same order: N where all are called
// "region N", otherwise 1, 2, ...
std::vector<std::int64_t> region_tags(const TetMesh& mesh);

}  // namespace palpate
