// Forces as a table, forces.csv: a line a step, or in the force loop a frame.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "palpate/simulation/frame.hpp"

namespace palpate {

class ForceTable {
 public:
  // names: of the organs.
  ForceTable(std::span<const Model> models, const std::vector<std::string>& names);
  // An organ each, of one moment. step: its number, or the tick's.
  void add(std::uint64_t step, std::span<const Frame> frames);
  void write(const std::filesystem::path& path) const;

 private:
  std::string text_;
};

}  // namespace palpate
