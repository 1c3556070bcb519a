// Statics of organs against CalculiX: largest difference at most 1e-6 of the largest displacement.
#include <fmt/format.h>

#include <filesystem>

#include "palpate/geometry/shapes.hpp"
#include "palpate/io/tet_file.hpp"
#include "palpate/pad/pad.hpp"
#include "support/calculix_compare.hpp"

namespace palpate::test {
namespace {

class CalculixOrgan : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Orders, CalculixOrgan, testing::Values(1, 2));

TEST_P(CalculixOrgan, KidneyWithStone) {
  PadOptions options;
  options.surface_nodes = GetParam() == 1 ? 1200 : 400;
  const Padded padded = pad(make_kidney(2000), {{"stone", make_stone(150)}}, options);
  std::vector<Material> materials;
  for (const std::string& region : padded.mesh.region_names)
    materials.push_back(region == "stone" ? Material{1e9, 0.3} : Material{10e3, 0.45});
  compare_with_calculix("kidney with stone", GetParam(), padded.mesh, materials,
                        "half-space 0 0 -0.016 0 0 1");
}

TEST_P(CalculixOrgan, Ventricle) {
  const char* given = std::getenv("PALPATE_DATA");
  const std::filesystem::path data =
      (given ? std::filesystem::path(given) : std::filesystem::path(PALPATE_SOURCE_DIR) / "../shared/data") /
      "derived/VH_F_left_ventricle.msh";
  if (!std::filesystem::exists(data)) GTEST_SKIP() << data << " is not there; set PALPATE_DATA";
  const TetMesh mesh = read_tets(data, 0.001).mesh;
  const double low = bounding_box(mesh.nodes).min.z();
  compare_with_calculix("left ventricle", GetParam(), mesh,
                        std::vector<Material>(mesh.region_names.size(), Material{30e3, 0.45}),
                        fmt::format("half-space 0 0 {} 0 0 1", low + 0.01));
}

}  // namespace
}  // namespace palpate::test
