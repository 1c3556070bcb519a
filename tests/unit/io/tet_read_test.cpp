#include <gtest/gtest.h>

#include <random>

#include "palpate/base/timer.hpp"
#include "tet_test.hpp"

namespace palpate {
namespace {

std::string message_of(const std::filesystem::path& path) {
  try {
    read_tets(path);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(TetRead, EveryFormatGivesTheSameMesh) {
  const TempFolder folder;
  for (const Sample& sample : samples()) {
    SCOPED_TRACE(sample.name);
    folder.write(sample.name, sample.bytes);
    EXPECT_TRUE(is_tet_file(folder / sample.name));
    const TetFile file = read_tets(folder / sample.name);
    TetMesh mesh = file.mesh;
    // Gmsh 4 lists the fifth node first in our samples.
    const bool turned = mesh.nodes[0] == Vec3(1, 1, 1);
    if (turned) {
      std::rotate(mesh.nodes.begin(), mesh.nodes.begin() + 1, mesh.nodes.end());
      for (Tetrahedron& t : mesh.tets)
        for (Index& v : t) v = (v + 4) % 5;
    }
    EXPECT_EQ(mesh.nodes, two_tets().nodes);
    EXPECT_EQ(mesh.tets, two_tets().tets);
    EXPECT_EQ(mesh.regions, two_tets().regions);
    const bool named =
        sample.bytes.find("kidney") != std::string::npos || sample.bytes.find("107 105") != std::string::npos;
    if (named) {
      EXPECT_EQ(mesh.region_names, two_tets().region_names);
    }
    if (sample.name.find("medit") == 0) {
      EXPECT_EQ(mesh.region_names, (std::vector<std::string>{"region 3", "region 9"}));
    }
    EXPECT_EQ(file.other_cells, 1u);
    EXPECT_EQ(file.inverted, 0u);
    EXPECT_EQ(file.higher_order, 0u);
    EXPECT_FALSE(file.format.empty());
  }
}

// The end of a file may be cut as long as nothing is lost; otherwise it is an error, and never another mesh.
TEST(TetRead, NoticesEveryTruncation) {
  const TempFolder folder;
  for (const Sample& sample : samples()) {
    SCOPED_TRACE(sample.name);
    folder.write(sample.name, sample.bytes);
    const TetMesh whole = read_tets(folder / sample.name).mesh;
    for (std::size_t size = 0; size < sample.bytes.size(); ++size) {
      folder.write(sample.name, sample.bytes.substr(0, size));
      try {
        const TetMesh mesh = read_tets(folder / sample.name).mesh;
        const bool names_only = mesh.nodes == whole.nodes && mesh.tets == whole.tets;
        ASSERT_TRUE(names_only) << "cut to " << size << " of " << sample.bytes.size() << ": "
                                << sample.bytes.substr(size, 40);
      } catch (const Error& error) {
        ASSERT_EQ(error.kind(), ErrorKind::format) << size << " " << error.what();
        ASSERT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      }
    }
  }
}

// Any bytes end in a mesh that refers to what is there, or in Error(format).
TEST(TetRead, SurvivesDamagedBytes) {
  const TempFolder folder;
  std::mt19937 random(5);
  [[maybe_unused]] const std::size_t before = peak_resident_bytes();
  for (const Sample& sample : samples())
    for (int i = 0; i < 400; ++i) {
      std::string bytes = sample.bytes;
      for (int flips = 1 + static_cast<int>(random() % 3); flips > 0; --flips) {
        char& c = bytes[random() % bytes.size()];
        switch (random() % 4) {
          case 0:
            c = static_cast<char>(c ^ 1 << random() % 8);
            break;
          case 1:
            c = static_cast<char>(random());
            break;
          case 2:
            c = "0123456789-. \n"[random() % 14];
            break;
          default:
            bytes.insert(random() % bytes.size(), std::to_string(random()));
            break;
        }
      }
      folder.write(sample.name, bytes);
      try {
        const TetMesh mesh = read_tets(folder / sample.name).mesh;
        ASSERT_EQ(mesh.regions.size(), mesh.tets.size());
        for (const Vec3& p : mesh.nodes) ASSERT_TRUE(p.allFinite());
        for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
          ASSERT_LT(static_cast<std::size_t>(mesh.regions[t]), mesh.region_names.size());
          for (const Index v : mesh.tets[t]) ASSERT_LT(static_cast<std::size_t>(v), mesh.nodes.size());
        }
      } catch (const Error& error) {
        ASSERT_EQ(error.kind(), ErrorKind::format) << error.what();
      }
    }
#ifndef __SANITIZE_ADDRESS__  // keeps freed memory
  EXPECT_LT(peak_resident_bytes() - before, std::size_t{100} << 20);
#endif
}

TEST(TetRead, TetGenFromEitherFileAndEitherBase) {
  const TempFolder folder;
  for (const int base : {0, 1}) {
    std::string nodes = "# nodes\n5 3 1 1\n", tets = "2 4 1 # tets\n";
    for (int i = 0; i < 5; ++i) {
      const Vec3 p = two_tets().nodes[static_cast<std::size_t>(i)];
      nodes += fmt::format("{} {} {} {} 0.5 1\n", i + base, p.x(), p.y(), p.z());
    }
    for (int i = 0; i < 2; ++i) {
      const Tetrahedron t = two_tets().tets[static_cast<std::size_t>(i)];
      tets += fmt::format("{} {} {} {} {} {}\n", i + base, t[0] + base, t[1] + base, t[2] + base, t[3] + base,
                          1.5 + i);
    }
    folder.write("a.1.node", nodes + "# made by hand\n");
    folder.write("a.1.ele", tets + "# made by hand\n");
    for (const char* name : {"a.1.node", "a.1.ele"}) {
      EXPECT_TRUE(is_tet_file(folder / name));
      const TetFile file = read_tets(folder / name);
      EXPECT_EQ(file.mesh.nodes, two_tets().nodes);
      EXPECT_EQ(file.mesh.tets, two_tets().tets);
      EXPECT_EQ(file.mesh.region_names, (std::vector<std::string>{"region 1.5", "region 2.5"}));
    }
    for (std::size_t size = 0; size < tets.size(); ++size) {
      folder.write("a.1.ele", tets.substr(0, size));
      ASSERT_EQ(kind_of([&] { read_tets(folder / "a.1.node"); }), ErrorKind::format) << size;
    }
    folder.write("a.1.ele", tets.substr(0, tets.size() - 1));  // 2.5 could have been 2.51
    EXPECT_EQ(kind_of([&] { read_tets(folder / "a.1.node"); }), ErrorKind::format);
    folder.write("a.1.ele", tets + "3 4\n");
    EXPECT_EQ(kind_of([&] { read_tets(folder / "a.1.node"); }), ErrorKind::format);
  }
  folder.write("b.node", "1 3 0 0\n0 0 0 0\n");
  EXPECT_EQ(kind_of([&] { read_tets(folder / "b.node"); }), ErrorKind::file);
}

TEST(TetRead, TakesCornersDropsNodesCountsInverted) {
  const TempFolder folder;
  std::string nodes = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n12\n";
  for (int i = 0; i < 12; ++i)
    nodes += fmt::format("{} {} {} {}\n", 100 - 7 * i, int{i == 1}, int{i == 2}, int{i == 3});
  folder.write("a.msh", nodes +
                            "$EndNodes\n$Elements\n3\n1 11 2 0 6 100 93 86 79 72 65 58 51 44 37\n"
                            "2 4 2 0 6 100 86 93 79\n3 15 2 0 6 100\n$EndElements\n");
  const TetFile file = read_tets(folder / "a.msh", 0.001);
  EXPECT_EQ(file.mesh.nodes, (std::vector<Vec3>{{0, 0, 0}, {0.001, 0, 0}, {0, 0.001, 0}, {0, 0, 0.001}}));
  EXPECT_EQ(file.mesh.tets, (std::vector<Tetrahedron>{{0, 1, 2, 3}, {0, 2, 1, 3}}));
  EXPECT_EQ(file.higher_order, 1u);
  EXPECT_EQ(file.other_cells, 1u);
  EXPECT_EQ(file.inverted, 1u);
  EXPECT_EQ(file.unused_nodes, 8u);
  EXPECT_EQ(file.mesh.region_names, std::vector<std::string>{"tissue"});
}

TEST(TetRead, SaysWhereAndWhat) {
  const TempFolder folder;
  const auto expect = [&](const std::string& name, const std::string& bytes,
                          const std::vector<std::string>& parts) {
    folder.write(name, bytes);
    const std::string message = message_of(folder / name);
    for (const std::string& part : parts)
      EXPECT_NE(message.find(part), std::string::npos) << part << " is not in: " << message;
  };
  const std::string head = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n";
  expect("a.msh", head + "2\n1 0 0 0\n2 0 nan 0\n$EndNodes\n", {"a.msh", "line 7", "node 2", "\"nan\""});
  expect("a.msh", head + "2\n1 0 0 0\n2 0 1e999 0\n$EndNodes\n", {"1e999"});
  expect("a.msh", head + "999999999999\n1 0 0 0\n", {"line 5", "999999999999"});
  expect("a.msh", head + "1\n1 0 0 0\n2 0 0 0\n$EndNodes\n", {"$EndNodes", "more than was announced"});
  expect("a.msh", head + "2\n1 0 0 0\n1 0 0 0\n$EndNodes\n$Elements\n1\n1 4 0 1 1 1 1\n$EndElements\n",
         {"node 1 is there twice"});
  expect("a.msh", head + "1\n1 0 0 0\n$EndNodes\n$Elements\n1\n1 4 0 1 1 1 7\n$EndElements\n",
         {"tetrahedron 1", "node 7"});
  expect("a.msh", head + "1\n1 0 0 0\n$EndNodes\n$Elements\n1\n1 4 0 1 1 1 1.5\n$EndElements\n",
         {"line 10", "1.5"});
  expect("a.msh", head + "1\n1 0 0 0\n$EndNodes\n$Elements\n1\n1 77 0 1 1 1 1\n$EndElements\n", {"type 77"});
  expect("a.msh", head + "1\n1 0 0 0\n$EndNodes\n$Elements\n1\n1 2 0 1 1 1\n$EndElements\n",
         {"holds no tetrahedra", "1 other cells"});
  expect("a.msh", "$MeshFormat\n4.0 0 8\n$EndMeshFormat\n", {"4"});
  expect("a.msh", "", {"is empty"});
  expect("a.msh", "hello\n", {"\"hello\""});
  expect("a.txt", "hello\n", {"is no tetrahedral mesh"});
  expect("a.vtu", "<VTKFile type=\"UnstructuredGrid\">\n<UnstructuredGrid>\n</VTKFile>\n", {"line 3", "XML"});
  expect("a.vtu", "<VTKFile type=\"UnstructuredGrid\" compressor=\"vtkLZ4DataCompressor\"/>", {"LZ4"});
  expect("a.vtk", "# vtk DataFile Version 2.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 double\n0 0\n",
         {"line 7", "ends early"});
  EXPECT_EQ(kind_of([&] { read_tets(folder / "absent.msh"); }), ErrorKind::file);
  EXPECT_EQ(kind_of([&] { read_tets(folder.path); }), ErrorKind::file);
  Bytes b;
  b << "$MeshFormat\n2.2 1 8\n";
  b.add<std::int32_t>({1}) << "\n$EndMeshFormat\n$Nodes\n1\n";
  b.add<std::int32_t>({1}).add<double>({0, std::numeric_limits<double>::quiet_NaN(), 0})
      << "\n$EndNodes\n$Elements\n1\n";
  b.add<std::int32_t>({4, 1, 0, 1, 1, 1, 1, 1}) << "\n$EndElements\n";
  expect("a.msh", b.bytes, {"node 1", "no finite number"});
  expect("a.msh", b.bytes.substr(0, b.bytes.find("$EndNodes") - 5), {"line 6", "25 bytes"});
}

TEST(TetRead, KnowsWhatIsNone) {
  const TempFolder folder;
  folder.write("a.vtk", "# vtk DataFile Version 2.0\n\nASCII\nDATASET POLYDATA\n");
  folder.write("a.vtu", "<VTKFile type=\"PolyData\">");
  folder.write("a.stl", "solid\n");
  for (const char* name : {"a.vtk", "a.vtu", "a.stl", "absent.stl"})
    EXPECT_FALSE(is_tet_file(folder / name)) << name;
  EXPECT_TRUE(is_tet_file(folder / "absent.msh"));
}

TEST(TetRead, KeptVentricleIsTheSameInEveryFormat) {
  if (kept_data("derived").empty()) GTEST_SKIP() << "test data is not here (PALPATE_DATA)";
  const TetMesh first = read_tets(kept_data("derived/VH_F_left_ventricle.msh"), 0.001).mesh;
  EXPECT_EQ(first.nodes.size(), 7030u);
  EXPECT_EQ(first.tets.size(), 27850u);
  EXPECT_EQ(quality(first).inverted, 0u);
  for (const char* name : {"v22_bin.msh", "v41_ascii.msh", "v41_bin.msh", "ascii.vtk", "bin.vtk", ".mesh"}) {
    const TetFile file = read_tets(
        kept_data(std::string("derived/VH_F_left_ventricle") + (name[0] == '.' ? "" : "_") + name), 0.001);
    EXPECT_EQ(file.mesh.tets, first.tets) << name;
    EXPECT_EQ(file.mesh.regions, first.regions) << name;
    EXPECT_EQ(file.mesh.region_names, std::vector<std::string>{"tissue"}) << name;
    double off = 0;
    ASSERT_EQ(file.mesh.nodes.size(), first.nodes.size());
    for (std::size_t i = 0; i < first.nodes.size(); ++i)
      off = std::max(off, (file.mesh.nodes[i] - first.nodes[i]).norm());
    EXPECT_LE(off, 1e-14) << name;  // text files hold 14 to 17 digits
  }
}

TEST(TetRead, KeptMeshesAreAsTheirProvenanceSays) {
  if (kept_data("tets").empty()) GTEST_SKIP() << "test data is not here (PALPATE_DATA)";
  struct Expected {
    const char* name;
    std::size_t nodes, tets, inverted, other;
    const char* format;
  };
  for (const Expected& e : {Expected{"tets/liver.msh", 181, 596, 0, 0, "Gmsh 1"},
                            Expected{"tets/liver2.msh", 507, 1493, 0, 931, "Gmsh 1"},
                            Expected{"tets/volumetricTongue.vtu", 2238, 10980, 0, 0, "VTK XML"},
                            Expected{"tets/biel3d.mesh", 2045, 7329, 0, 3126, "MEDIT text"},
                            Expected{"tets/6_tetra_bad.msh", 17, 6, 1, 0, "Gmsh 2.2 text"},
                            Expected{"derived/VH_M_Kidney_L_coarse.1.node", 6511, 30583, 0, 0, "TetGen"},
                            Expected{"derived/VH_M_Kidney_L_coarse.1.ele", 6511, 30583, 0, 0, "TetGen"}}) {
    const TetFile file = read_tets(kept_data(e.name));
    EXPECT_EQ(file.mesh.nodes.size(), e.nodes) << e.name;
    EXPECT_EQ(file.mesh.tets.size(), e.tets) << e.name;
    EXPECT_EQ(file.inverted, e.inverted) << e.name;
    EXPECT_EQ(file.other_cells, e.other) << e.name;
    EXPECT_EQ(file.format, e.format) << e.name;
  }
}

}  // namespace
}  // namespace palpate
