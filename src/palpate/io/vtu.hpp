// VTK XML unstructured grids for ParaView, and collections of them in time (.pvd).
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "palpate/geometry/tet_mesh.hpp"

namespace palpate {

// A named array on points or cells: values.size() = components * number of points or cells.
struct VtuField {
  std::string name;
  int components = 1;
  std::vector<float> values;
};

void write_vtu(const std::filesystem::path& path, std::span<const Vec3> points,
               std::span<const Triangle> triangles, const std::vector<VtuField>& point_fields = {},
               const std::vector<VtuField>& cell_fields = {});
void write_vtu(const std::filesystem::path& path, const TetMesh& mesh,
               const std::vector<VtuField>& point_fields = {}, const std::vector<VtuField>& cell_fields = {});

struct PvdEntry {
  double time = 0;   // s
  std::string file;  // relative to the .pvd
};
void write_pvd(const std::filesystem::path& path, std::span<const PvdEntry> entries);

}  // namespace palpate
