#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <cmath>

#include "tet_test.hpp"

namespace palpate {
namespace {

const std::vector<std::string> all{"a.msh", "a.mesh", "a.vtk", "a.vtu", "a.node"};

// Any finite doubles as coordinates, tetrahedra of distinct nodes that use all of them, every region used.
TetMesh random_mesh(bool named) {
  TetMesh mesh;
  const auto tets = *rc::gen::inRange<std::size_t>(1, 30);
  const auto nodes = *rc::gen::inRange<std::size_t>(4, 4 * tets + 1);
  const auto regions = *rc::gen::inRange<std::size_t>(1, std::min<std::size_t>(tets, 5) + 1);
  for (std::size_t i = 0; i < nodes; ++i) {
    Vec3 p;
    for (int k = 0; k < 3; ++k) {
      std::uint64_t bits = *rc::gen::arbitrary<std::uint64_t>();
      std::memcpy(&p[k], &bits, 8);
      if (!std::isfinite(p[k])) p[k] = 1.0 / 3;
    }
    mesh.nodes.push_back(p);
  }
  for (std::size_t i = 0; i < tets; ++i) {
    Tetrahedron t;
    for (std::size_t k = 0; k < 4; ++k) t[k] = static_cast<Index>((4 * i + k) % nodes);
    mesh.tets.push_back(t);
    mesh.regions.push_back(static_cast<Index>(i % regions));
  }
  for (std::size_t r = 0; r < regions; ++r)
    mesh.region_names.push_back(
        named ? fmt::format("{}{}", r, *rc::gen::container<std::string>(rc::gen::inRange<char>(0x20, 0x7f)))
        : regions == 1 ? "tissue"
                       : fmt::format("region {}", 3 * r + 2));
  return mesh;
}

RC_GTEST_PROP(TetWrite, ReadsBackBitForBit, ()) {
  const TempFolder folder;
  for (const std::string& name : all) {
    const bool keeps_names = name != "a.mesh" && name != "a.node";
    const TetMesh mesh = random_mesh(keeps_names);
    write_tets(folder / name, mesh);
    const TetMesh back = read_tets(folder / name).mesh;
    RC_ASSERT(back.nodes.size() == mesh.nodes.size());
    RC_ASSERT(std::memcmp(back.nodes.data(), mesh.nodes.data(), 24 * mesh.nodes.size()) == 0);
    RC_ASSERT(back == mesh);
  }
}

TEST(TetWrite, NamesThatFormatsDoNotHoldBecomeNumbers) {
  const TempFolder folder;
  write_tets(folder / "a.mesh", two_tets());
  EXPECT_EQ(read_tets(folder / "a.mesh").mesh.region_names,
            (std::vector<std::string>{"region 1", "region 2"}));
}

TEST(TetWrite, DividesByTheUnit) {
  const TempFolder folder;
  for (const std::string& name : all) {
    write_tets(folder / name, two_tets(), 0.001);
    EXPECT_EQ(read_tets(folder / name).mesh.nodes[1], Vec3(1000, 0, 0)) << name;
    EXPECT_EQ(read_tets(folder / name, 0.001).mesh.nodes, two_tets().nodes) << name;
  }
}

TEST(TetWrite, LeavesNothingWhenTheDiskIsFull) {
  TetMesh mesh = two_tets();
  for (int i = 0; i < 3000; ++i)
    mesh.nodes.push_back(Vec3::Constant(i)), mesh.tets.push_back({0, 1, 2, 5 + i}), mesh.regions.push_back(0);
  for (const std::string& name : all)
    for (const std::size_t limit : {0, 100, 20000, 40000}) {
      const TempFolder folder;
      const FileSizeLimit full(limit);
      EXPECT_EQ(kind_of([&] { write_tets(folder / name, mesh); }), ErrorKind::file) << name << " " << limit;
      EXPECT_EQ(folder.files(), 0u) << name << " " << limit;
    }
}

TEST(TetWrite, RefusesWhatItCannotWrite) {
  const TempFolder folder;
  EXPECT_EQ(kind_of([&] { write_tets(folder / "a.stl", two_tets()); }), ErrorKind::usage);
  TetMesh mesh = two_tets();
  mesh.tets[0][2] = 5;
  EXPECT_EQ(kind_of([&] { write_tets(folder / "a.msh", mesh); }), ErrorKind::internal);
  EXPECT_EQ(folder.files(), 0u);
}

}  // namespace
}  // namespace palpate
