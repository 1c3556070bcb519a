#include "palpate/simulation/handover.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "fixtures.hpp"
#include "palpate/io/atomic_file.hpp"
#include "unit/io/io_test.hpp"

namespace palpate {
namespace {

// A triangle as it is, whichever corner it begins with.
Triangle turned(Triangle t) {
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  return t;
}

std::multiset<Triangle> set_of(const std::vector<Triangle>& triangles) {
  std::multiset<Triangle> set;
  for (const Triangle& t : triangles) set.insert(turned(t));
  return set;
}

TEST(Handover, StripsHoldEveryTriangleOnceWithItsSide) {
  for (const TriangleMesh& mesh : {make_sphere(Vec3::Zero(), 1, 12, 16), block_organ(4).surface}) {
    const std::vector<std::vector<Index>> strips = make_strips(mesh.triangles);
    std::vector<Triangle> triangles;
    for (const auto& strip : strips)
      for (const Triangle& t : strip_triangles(strip)) triangles.push_back(t);
    EXPECT_EQ(set_of(triangles), set_of(mesh.triangles));
    EXPECT_LT(5 * strips.size(), mesh.triangles.size());  // greedy, yet long
  }
  // Triangles that share nothing, or face opposite ways, are strips of their own.
  EXPECT_EQ(make_strips({{0, 1, 2}, {3, 4, 5}, {0, 1, 3}}).size(), 3u);
}

TEST(Handover, GivesBackTheModel) {
  const TempFolder folder;
  const Organ organ = block_organ(3);
  write_handover(folder / "a.handover", organ);
  const Organ back = read_handover(folder / "a.handover");
  EXPECT_EQ(back.surface.vertices, organ.surface.vertices);
  EXPECT_EQ(set_of(back.surface.triangles), set_of(organ.surface.triangles));
  EXPECT_EQ(back.row_of, organ.row_of);
  EXPECT_EQ(back.node_of_row, organ.node_of_row);
  ASSERT_EQ(back.materials.size(), 1u);
  EXPECT_EQ(back.materials[0].young, 10e3);
  EXPECT_EQ(back.materials[0].poisson, 0.45);
  EXPECT_TRUE(back.mesh.tets.empty());
  ASSERT_EQ(back.compliance.nodes(), organ.compliance.nodes());
  EXPECT_TRUE(std::equal(back.compliance.matrix().begin(), back.compliance.matrix().end(),
                         organ.compliance.matrix().begin()));
  EXPECT_NEAR(back.areas[5], organ.areas[5], 1e-15);
  write_organ(folder / "a.h5", back, "test");
  const Organ again = read_organ(folder / "a.h5");
  EXPECT_EQ(again.row_of, organ.row_of);
  EXPECT_EQ(again.compliance.matrix()[7], organ.compliance.matrix()[7]);
}

// Two free points and one anchored, by hand as in T eq. 5.5, and what is wrong with it.
const std::string by_hand =
    "3 1 1 1 1000 0.3 1100\n"
    "2 1 0 0 0 0 0 0 0 1 2 0 0 0 0 0 0 0 0 0 2 0 0 0 0 0 0 "
    "0 0 0 1 0 0 0 0 0 0 0 0 0 1 0 0 0 0 0 0 0 0 0 1 0 0 0 "
    "0 0 0 0 0 0 3 0 0 0 0 0 0 0 0 0 3 0 0 0 0 0 0 0 0 0 3\n"
    "0 2 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n1\n3\n3\n0 1 2\n1 1 1\n0 0 1 1 0 0 0 0 1\n";

ErrorKind reading(const TempFolder& folder, const std::string& bytes) {
  folder.write("b.handover", bytes);
  return kind_of([&] { read_handover(folder / "b.handover"); });
}

std::string with(const std::string& from, const std::string& to) {
  std::string text = by_hand;
  return text.replace(text.find(from), from.size(), to);
}

TEST(Handover, ReadsWhatWasWrittenByHand) {
  const TempFolder folder;
  folder.write("a.handover", by_hand);
  const Organ organ = read_handover(folder / "a.handover");
  EXPECT_EQ(organ.row_of, (std::vector<Index>{0, -1, 1}));
  ASSERT_EQ(organ.compliance.nodes(), 2u);
  EXPECT_EQ(organ.compliance.matrix()[1], 1);
  EXPECT_EQ(organ.compliance.matrix()[35], 3);
  EXPECT_EQ(organ.materials[0].density, 1100);
  EXPECT_EQ(reading(folder, with("3 1 1", "3 1 0")), ErrorKind::format);  // not inverted
  EXPECT_EQ(reading(folder, with("2 1 0", "2 nan 0")), ErrorKind::format);
  EXPECT_EQ(reading(folder, with("2 1 0", "2 3 0")), ErrorKind::format);  // not symmetric
  EXPECT_EQ(reading(folder, with("2 0 0 0 0 0 0 0 0", "-2 0 0 0 0 0 0 0 0")), ErrorKind::format);
  EXPECT_EQ(reading(folder, with("0 2 0\n", "0 0 0\n")), ErrorKind{});        // then it is a plain point
  EXPECT_EQ(reading(folder, with("0 2 0\n", "2 0 0\n")), ErrorKind::format);  // not the identity there
  EXPECT_EQ(reading(folder, with("0 2 0\n", "1 1 1\n")), ErrorKind::format);
  EXPECT_EQ(reading(folder, with("0 1 2\n", "0 1 3\n")), ErrorKind::format);
  EXPECT_EQ(reading(folder, with("1\n3\n3\n", "1\n3\n4\n")), ErrorKind::format);
  EXPECT_EQ(reading(folder, with("3 1 1", "3 2 1")), ErrorKind::format);
  EXPECT_EQ(reading(folder, with("0.3", "0.5")), ErrorKind::physics);
  EXPECT_EQ(reading(folder, with("3 1 1", "300000 1 1")), ErrorKind::format);
  EXPECT_EQ(reading(folder, by_hand + "1\n"), ErrorKind::format);
  EXPECT_EQ(kind_of([&] { read_handover(folder / "absent"); }), ErrorKind::file);
}

TEST(Handover, NoticesTruncationAndSurvivesDamage) {
  const TempFolder folder;
  for (std::size_t size = 0; size < by_hand.size(); ++size)
    ASSERT_EQ(reading(folder, by_hand.substr(0, size)), ErrorKind::format) << size;
  std::mt19937 random(3);
  for (int i = 0; i < 3000; ++i) {
    std::string bytes = by_hand;
    for (int flips = 1 + static_cast<int>(random() % 3); flips > 0; --flips)
      bytes[random() % bytes.size()] =
          random() % 2 ? static_cast<char>(random()) : "0123456789-. \n"[random() % 14];
    const ErrorKind kind = reading(folder, bytes);
    ASSERT_TRUE(kind == ErrorKind{} || kind == ErrorKind::format || kind == ErrorKind::physics) << bytes;
  }
}

TEST(Handover, LeavesNothingWhenTheDiskIsFull) {
  const TempFolder folder;
  const Organ organ = block_organ(2);
  {
    const FileSizeLimit full(1000);
    EXPECT_EQ(kind_of([&] { write_handover(folder / "a.handover", organ); }), ErrorKind::file);
  }
  EXPECT_EQ(folder.files(), 0u);
}

}  // namespace
}  // namespace palpate
