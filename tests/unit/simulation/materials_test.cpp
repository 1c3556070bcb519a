#include "palpate/simulation/materials.hpp"

#include <gtest/gtest.h>

#include "fixtures.hpp"
#include "palpate/base/error.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "palpate/io/vtu.hpp"
#include "unit/io/tet_test.hpp"

namespace palpate {
namespace {

TetFile block_with_cells(bool young, bool poisson) {
  TetFile file;
  file.mesh = make_block({Vec3::Zero(), Vec3::Constant(0.1)}, {2, 2, 2});
  file.mesh.region_names = {"low", "high"};
  for (std::size_t t = 0; t < file.mesh.tets.size(); ++t) {
    file.mesh.regions[t] = t % 3 == 0;
    if (young) file.young.push_back(1e4 + static_cast<double>(t));
    if (poisson) file.poisson.push_back(0.3);
  }
  return file;
}

ErrorKind kind_of(const TetFile& file, const std::vector<RegionMaterial>& given) {
  try {
    materials_of(file, given);
  } catch (const Error& error) {
    return error.kind();
  }
  return static_cast<ErrorKind>(0);
}

TEST(Materials, OfRegions) {
  const TetFile file = block_with_cells(false, false);
  const auto all = materials_of(file, parse_region_materials({"2e4,0.4", "high=spleen"}));
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].young, 2e4);
  EXPECT_EQ(all[1].young, 2.9e3);
  EXPECT_EQ(kind_of(file, {}), ErrorKind::usage);
  EXPECT_EQ(kind_of(file, {{"low", {1e4, 0.3}}}), ErrorKind::usage);
  EXPECT_EQ(kind_of(file, {{"middle", {1e4, 0.3}}}), ErrorKind::usage);
}

TEST(Materials, OfTetrahedraAndRegionsOverThem) {
  TetFile file = block_with_cells(true, true);
  const auto all = materials_of(file, {{"high", {5e3, 0.4, 1100}}});
  ASSERT_EQ(all.size(), file.mesh.tets.size());
  for (std::size_t t = 0; t < all.size(); ++t) {
    EXPECT_EQ(all[t].young, t % 3 == 0 ? 5e3 : 1e4 + static_cast<double>(t));
    EXPECT_EQ(all[t].density, t % 3 == 0 ? 1100 : 1000);
  }
  EXPECT_EQ(kind_of(block_with_cells(true, false), {}), ErrorKind::usage);
  file.young[7] = -1;
  EXPECT_EQ(kind_of(file, {}), ErrorKind::physics);
}

// As many tetrahedra as regions: nothing tells lists of the two apart but what is in them.
TEST(Materials, TwoTetrahedraInTwoRegions) {
  TetFile file;
  file.mesh = two_tets();
  file.mesh.region_names = {"a", "b"};
  file.mesh.regions = {1, 0};
  file.young = {1e3, 2e3}, file.poisson = {0.3, 0.3};
  const auto all = materials_of(file, {});
  EXPECT_EQ(material_of(file.mesh, all, 0).young, 1e3);
  EXPECT_EQ(material_of(file.mesh, all, 1).young, 2e3);
}

TEST(Materials, ComeFromCellArraysOfAFile) {
  const TempFolder folder;
  const TetFile file = block_with_cells(true, true);
  VtuField young{"young", 1, {}}, poisson{"poisson", 1, {}}, density{"density", 1, {}};
  for (const double e : file.young) young.values.push_back(static_cast<float>(e));
  poisson.values.assign(file.young.size(), 0.25f), density.values.assign(file.young.size(), 1050.0f);
  write_vtu(folder / "a.vtu", file.mesh, {}, {young, poisson, density});
  const TetFile back = read_tets(folder / "a.vtu", 0.001);  // the unit is of lengths
  EXPECT_EQ(back.young, file.young);
  EXPECT_EQ(back.poisson, std::vector<double>(file.young.size(), 0.25));
  EXPECT_EQ(back.density, std::vector<double>(file.young.size(), 1050.0));
  folder.write("a.vtk",
               "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n0 0 0 1 0 0 "
               "0 1 0 0 0 1 "
               "1 1 1\nCELLS 3 14\n4 0 1 2 3\n3 0 1 2\n4 1 2 3 4\nCELL_TYPES 3\n10 5 10\nCELL_DATA "
               "3\nSCALARS young double "
               "1\nLOOKUP_TABLE default\n1000 7 2000\nFIELD f 1\npoisson 1 3 float\n0.25 7 0.5\n");
  const TetFile legacy = read_tets(folder / "a.vtk");
  EXPECT_EQ(legacy.young, (std::vector<double>{1000, 2000}));  // the triangle's is left out
  EXPECT_EQ(legacy.poisson, (std::vector<double>{0.25, 0.5}));
  EXPECT_TRUE(legacy.density.empty());
}

TEST(Materials, BeddingAndMaterialsOfTetrahedraInAModelFile) {
  const TempFolder folder;
  TetFile file = block_with_cells(true, true);
  const Organ a = bake(file.mesh, materials_of(file, {}), {}, 0, {}, nullptr,
                       {.beddings = {parse_bedding("1e5 half-space 0 0 0 0 0 1")}});
  EXPECT_EQ(a.compliance.nodes(), a.surface_size());  // nothing is anchored
  write_organ(folder / "a.h5", a, "test");
  Organ b = read_organ(folder / "a.h5");
  EXPECT_EQ(b.materials.size(), file.mesh.tets.size());
  EXPECT_EQ(b.beddings.size(), 1u);
  EXPECT_EQ(b.hash, a.hash);
  b.beddings[0].modulus *= 2;  // other springs with the old compliance
  write_organ(folder / "b.h5", b, "test");
  EXPECT_THROW(read_organ(folder / "b.h5"), Error);
}

}  // namespace
}  // namespace palpate
