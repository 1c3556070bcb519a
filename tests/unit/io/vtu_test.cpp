#include "palpate/io/vtu.hpp"

#include <gtest/gtest.h>

#include "io_test.hpp"
#include "palpate/io/atomic_file.hpp"

namespace palpate {
namespace {

TEST(Vtu, WritesBytesThatWereWorkedOutByHand) {
  const TempFolder folder;
  const std::vector<Vec3> points{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<Triangle> triangles{{0, 1, 2}};
  write_vtu(folder / "a.vtu", points, triangles, {{"a<b", 1, {1, 2, 3}}}, {{"c", 2, {0, 1}}});
  const std::string text = read_file(folder / "a.vtu");
  const auto has = [&](const std::string& s) { return text.find(s) != std::string::npos; };
  EXPECT_TRUE(has("byte_order=\"LittleEndian\" header_type=\"UInt64\""));
  EXPECT_TRUE(has("NumberOfPoints=\"3\" NumberOfCells=\"1\""));
  EXPECT_TRUE(has("Name=\"a&lt;b\""));
  // 12 as eight bytes, then 0, 1, 2 as four each
  EXPECT_TRUE(
      has("Name=\"connectivity\" NumberOfComponents=\"1\" format=\"binary\">\n"
          "DAAAAAAAAAAAAAAAAQAAAAIAAAA=\n"));
  EXPECT_TRUE(has("Name=\"offsets\" NumberOfComponents=\"1\" format=\"binary\">\nBAAAAAAAAAADAAAA\n"));
  EXPECT_TRUE(has("Name=\"types\" NumberOfComponents=\"1\" format=\"binary\">\nAQAAAAAAAAAF\n"));
  EXPECT_TRUE(has("Name=\"c\" NumberOfComponents=\"2\" format=\"binary\">\nCAAAAAAAAAAAAAAAAACAPw==\n"));
}

TEST(Vtu, RefusesFieldsOfTheWrongSize) {
  const TempFolder folder;
  const std::vector<Vec3> points(3, Vec3::Zero());
  const std::vector<Triangle> triangles{{0, 1, 2}};
  EXPECT_EQ(kind_of([&] {
              write_vtu(folder / "a.vtu", points, triangles, {{"a", 1, {1}}});
            }),
            ErrorKind::internal);
  EXPECT_EQ(folder.files(), 0u);
}

TEST(Vtu, LeavesNothingWhenTheDiskIsFull) {
  const TempFolder folder;
  TetMesh mesh;
  mesh.nodes.assign(3000, Vec3::Zero());
  mesh.tets.assign(3000, {0, 1, 2, 3});
  mesh.regions.assign(3000, 0);
  mesh.region_names = {"tissue"};
  {
    const FileSizeLimit full(20000);
    EXPECT_EQ(kind_of([&] { write_vtu(folder / "a.vtu", mesh); }), ErrorKind::file);
  }
  EXPECT_EQ(folder.files(), 0u);
}

TEST(Vtu, CollectsFramesInTime) {
  const TempFolder folder;
  const std::vector<PvdEntry> entries{{0, "f0.vtu"}, {0.1, "a&b.vtu"}};
  write_pvd(folder / "a.pvd", entries);
  EXPECT_NE(read_file(folder / "a.pvd").find("timestep=\"0.1\" part=\"0\" file=\"a&amp;b.vtu\""),
            std::string::npos);
}

}  // namespace
}  // namespace palpate
