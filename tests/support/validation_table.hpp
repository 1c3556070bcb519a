// Measured figures as CSV, for docs/validation.md: PALPATE_VALIDATION=folder test_convergence writes them
// all.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace palpate::test {

// Appends to folder/table.csv, the header first where there is no file yet; nothing without the variable.
inline void validation_row(const std::string& table, const std::string& header, const std::string& row) {
  const char* const folder = std::getenv("PALPATE_VALIDATION");
  if (!folder || !*folder) return;
  std::filesystem::create_directories(folder);
  const std::filesystem::path path = std::filesystem::path(folder) / (table + ".csv");
  const bool is_new = !std::filesystem::exists(path);
  std::ofstream out(path, std::ios::app);
  if (is_new) out << header << '\n';
  if (!(out << row << '\n')) std::abort();  // a figure that is lost would be missed by nobody
}

}  // namespace palpate::test
