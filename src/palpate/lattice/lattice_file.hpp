// Lattices to and from files: HDF5 (container.hpp, kind "lattice"), the thesis' text (T 5.1.1: seven numbers
// a line, x y z, closest point, distance positive inside), and .vtu of the grid for ParaView.
#pragma once

#include <filesystem>

#include "palpate/lattice/lattice.hpp"

namespace palpate {

void write_lattice(const std::filesystem::path& path, const LatticeSamples& samples,
                   const TriangleMesh& surface, const std::string& provenance);
struct LatticeFile {
  LatticeSamples samples;
  TriangleMesh surface;  // what it was made of, for drawing; empty when read from text
};
// HDF5 or text, by content.
LatticeFile read_lattice(const std::filesystem::path& path);
void write_lattice_text(const std::filesystem::path& path, const LatticeSamples& samples);

}  // namespace palpate
