#include "palpate/elasticity/calculix.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <sstream>

#include "palpate/base/error.hpp"
#include "palpate/elasticity/anchor.hpp"
#include "palpate/io/atomic_file.hpp"
#include "support/calculix_compare.hpp"
#include "support/meshes.hpp"

namespace palpate::test {
namespace {

class CalculixReference : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Orders, CalculixReference, testing::Values(1, 2));

TEST_P(CalculixReference, BlockOfOneMaterial) {
  const int n = GetParam() == 1 ? 8 : 5;
  compare_with_calculix("block", GetParam(), jittered_block({n + 2, n + 1, n}), {{10e3, 0.45}},
                        "half-space 0 0 0.03 0 0 1");
}

TEST_P(CalculixReference, Beam) {
  const int n = GetParam() == 1 ? 4 : 2;
  compare_with_calculix("beam", GetParam(), make_block({Vec3::Zero(), Vec3(0.2, 0.02, 0.02)}, {10 * n, n, n}),
                        {{1e6, 0.3}}, "half-space 0 0 0 1 0 0");
}

TEST_P(CalculixReference, GradedBracketOfThreeMaterials) {
  const TetMesh mesh = graded_bracket(GetParam() == 1 ? 16 : 8);
  compare_with_calculix("bracket, one material", GetParam(), mesh,
                        std::vector<Material>(3, Material{10e3, 0.45}), "box -1 -1 -1 1 1 -0.0399");
  compare_with_calculix("bracket, three materials", GetParam(), mesh,
                        {{5e3, 0.3}, {10e3, 0.45}, {500e3, 0.49}}, "box -1 -1 -1 1 1 -0.0399");
}

TEST_P(CalculixReference, EachTetrahedronItsOwnMaterial) {
  const int n = GetParam() == 1 ? 6 : 4;
  const TetMesh mesh = jittered_block({n, n, n});
  std::vector<Material> materials;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    materials.push_back(
        {1e3 * (5.0 + static_cast<double>(t * 7919 % 101)), 0.2 + 0.01 * static_cast<double>(t % 25)});
  compare_with_calculix("block, a material each tetrahedron", GetParam(), mesh, materials,
                        "half-space 0 0 0.03 0 0 1");
}

std::string deck_of(const TetMesh& mesh, const std::vector<Material>& materials,
                    const std::vector<std::uint8_t>& anchored, const std::vector<Vec3>& forces) {
  const auto path = std::filesystem::temp_directory_path() / "palpate-calculix-test.inp";
  write_calculix(path, mesh, element_nodes(mesh, 1), materials, anchored, forces);
  const std::string deck = read_file(path);
  std::filesystem::remove(path);
  return deck;
}

TEST(CalculixDeck, FitsTheReadersLimits) {
  TetMesh mesh = jittered_block({2, 2, 2});
  for (Vec3& p : mesh.nodes) p = -1e-3 * p / 3;
  for (Tetrahedron& t : mesh.tets) std::swap(t[0], t[1]);
  mesh.region_names = {std::string("a, very\n*STEP strange name ") + std::string(300, 'x'),
                       "without tetrahedra"};
  std::vector<std::uint8_t> anchored(mesh.nodes.size(), 0);
  anchored[0] = anchored[4] = 1;
  std::vector<Vec3> forces(mesh.nodes.size(), Vec3::Zero());
  forces[3] = Vec3(0, -1.0 / 3 * 1e-120, 0);
  const std::string deck = deck_of(mesh, {{1e4 / 3, 0.3}, {1e4, 0.3}}, anchored, forces);
  std::istringstream lines(deck);
  for (std::string line; std::getline(lines, line);) {
    EXPECT_LT(line.size(), 132u) << line;
    if (line.find('*') == 0) continue;
    std::istringstream words(line);
    for (std::string word; std::getline(words, word, ',');) EXPECT_LE(word.size(), 20u) << line;
  }
  const auto times = [&](const std::string& text) {
    std::size_t n = 0;
    for (std::size_t at = 0; (at = deck.find(text, at)) != deck.npos; ++at) ++n;
    return n;
  };
  EXPECT_EQ(times("\n*STEP"), 1u);
  EXPECT_EQ(times("*MATERIAL"), 1u);
  EXPECT_EQ(times("*NSET, NSET=ANCHOR\n1\n5\n*BOUNDARY\nANCHOR,1,3\n"), 1u);
  EXPECT_EQ(times("*CLOAD\n4,2,-3.333333333333e-121\n*NODE PRINT"), 1u);
}

TEST(CalculixDeck, BadInputIsNamedAndLeavesNoFile) {
  const TetMesh mesh = jittered_block({2, 2, 2});
  const std::vector<std::uint8_t> none(mesh.nodes.size(), 0);
  const auto path = std::filesystem::temp_directory_path() / "palpate-calculix-bad.inp";
  std::vector<Vec3> forces(mesh.nodes.size(), Vec3::Zero());
  forces[1].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(write_calculix(path, mesh, element_nodes(mesh, 1), {{1e4, 0.3}}, none, forces), Error);
  EXPECT_THROW(write_calculix(path, mesh, element_nodes(mesh, 1), {}, none, {}), Error);
  EXPECT_THROW(write_calculix(path, mesh, element_nodes(mesh, 1), {{1e4, 0.5}}, none, {}), Error);
  EXPECT_THROW(write_calculix(path, mesh, element_nodes(mesh, 1), {{1e4, 0.3}}, {}, {}), Error);
  EXPECT_THROW(write_calculix(path, mesh, element_nodes(mesh, 1), {{1e4, 0.3}}, none, {Vec3::Zero()}), Error);
  EXPECT_THROW(
      write_calculix("/nonexistent/folder/a.inp", mesh, element_nodes(mesh, 1), {{1e4, 0.3}}, none, {}),
      Error);
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace palpate::test
