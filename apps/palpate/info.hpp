// What run_info's parts share: facts as aligned lines, and the same as one object.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "commands.hpp"
#include "palpate/geometry/tet_mesh.hpp"

namespace palpate {

struct Facts {
  nlohmann::json object;
  std::vector<std::pair<std::string, std::string>> lines;  // name, text

  Facts(const std::filesystem::path& file, const std::string& kind)
      : object{{"file", file.string()}, {"kind", kind}} {}
  void add(const std::string& name, const std::string& text) { lines.emplace_back(name, text); }
  void add_box(const Box& box, const std::string& unit);  // and whether the unit can be right
  void print(const Console& console) const;
};

std::string count(std::size_t n, const std::string& one, const std::string& many);  // "1 edge", "2 edges"

// Counts as a row of bars, the largest full: "▁▂▅█▃". Where there is anything, at least the lowest bar.
std::string bars(std::span<const std::size_t> counts);
// Lines "angles" and "volumes": histograms of a mesh's tetrahedra.
std::vector<std::pair<std::string, std::string>> histogram_lines(const TetQuality& q);

// What is drawn in place of the organ's surface, and how far it is off; errors below 0: not known.
std::string drawing_text(std::size_t triangles, std::size_t vertices, double rms, double most);

// info_files.cpp: a lattice or a model.
void info_container(const InfoOptions& options, const std::string& kind, const Console& console);

}  // namespace palpate
