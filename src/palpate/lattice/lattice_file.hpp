// Lattices to and from files: HDF5 (container.hpp, kind "lattice"), the thesis' text (T 5.1.1: seven numbers
// a line, x y z, closest point, distance positive inside), and .vti (VTK image data) for ParaView.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "palpate/lattice/lattice.hpp"

namespace palpate {

// HDF5, layout in docs/lattice.md.
void write_lattice(const std::filesystem::path& path, const LatticeSamples& samples,
                   const TriangleMesh& surface, const std::string& provenance);

struct LatticeFile {
  LatticeSamples samples;
  TriangleMesh surface;    // what it was made of, for drawing; empty when read from text
  std::string provenance;  // likewise
};
// HDF5 or text, by content. Throws Error(file), Error(format): damaged, truncated, not a regular grid, a
// value that is no number.
LatticeFile read_lattice(const std::filesystem::path& path);

// Six significant digits, as the thesis prints. Reading them back gives the grid to about 1e-5 of its
// coordinates.
void write_lattice_text(const std::filesystem::path& path, const LatticeSamples& samples);
void write_lattice_text(const std::function<void(std::string_view)>& sink, const LatticeSamples& samples);
// `what` names the text in messages.
LatticeSamples parse_lattice_text(std::string_view text, const std::string& what);

void write_lattice_vti(const std::filesystem::path& path, const LatticeSamples& samples);

}  // namespace palpate
