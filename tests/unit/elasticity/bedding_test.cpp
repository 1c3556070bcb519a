#include "palpate/elasticity/bedding.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "palpate/base/error.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "support/meshes.hpp"
#include "support/statics.hpp"

namespace palpate::test {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
constexpr double modulus = 3e5;

class BeddingOrders : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Orders, BeddingOrders, testing::Values(1, 2));

// Springs alone, K left out.
Sparse springs(const TetMesh& mesh, const ElementNodes& nodes, const std::vector<Bedding>& beddings) {
  const Material soft{1e-12, 0};
  Sparse k = assemble_stiffness(mesh, nodes, std::vector<Material>(mesh.region_names.size(), soft));
  k *= 0;
  add_bedding(mesh, nodes, beddings, k);
  return k;
}

TEST_P(BeddingOrders, ALinearDisplacementMeetsItsIntegrals) {
  const TetMesh mesh = jittered_block({4, 3, 3});  // base at z = 0.03, 6 cm by 5 cm from (0.01, -0.02)
  const ElementNodes nodes = element_nodes(mesh, GetParam());
  const Sparse k = springs(mesh, nodes, {parse_bedding("3e5 half-space 0 0 0.03 0 0 1")});
  EXPECT_EQ(Eigen::MatrixXd(k), Eigen::MatrixXd(k.transpose()));
  // u = (x, 1, y) over the base: energy is the integral of modulus |u|^2.
  std::vector<Vec3> u, one(nodes.size(), Vec3::UnitZ());
  for (const Vec3& p : nodes.positions) u.emplace_back(p.x(), 1, p.y());
  const auto cubes = [](double a, double b) { return (b * b * b - a * a * a) / 3; };
  const double area = 0.06 * 0.05;
  const double squares = 0.05 * cubes(0.01, 0.07) + area + 0.06 * cubes(-0.02, 0.03);
  EXPECT_NEAR(flat(u).dot(k * flat(u)), modulus * squares, 1e-12 * modulus * squares);
  EXPECT_NEAR(flat(one).dot(k * flat(one)), modulus * area, 1e-12 * modulus * area);
}

// A column without lateral strain under an even traction: spring and column in series.
TEST_P(BeddingOrders, AColumnOnSprings) {
  const TetMesh mesh = make_block({Vec3::Zero(), Vec3(0.02, 0.02, 0.05)}, {2, 2, 4});
  const ElementNodes nodes = element_nodes(mesh, GetParam());
  const Material material{10e3, 0.0};
  Sparse k = assemble_stiffness(mesh, nodes, {material});
  add_bedding(mesh, nodes, {{modulus, AnchorHalfSpace{Vec3::Zero(), Vec3::UnitZ()}}}, k);
  Vector exact(k.rows());
  const double traction = 100;  // Pa
  for (std::size_t i = 0; i < nodes.size(); ++i)
    exact.segment<3>(3 * static_cast<Eigen::Index>(i)) =
        Vec3(0, 0, traction / modulus + traction * nodes.positions[i].z() / material.young);
  // The forces that hold it are on the top only, and sum to the traction.
  const Vector force = k * exact;
  double total = 0;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Vec3 f = force.segment<3>(3 * static_cast<Eigen::Index>(i));
    if (nodes.positions[i].z() > 0.0499) total += f.z();
    EXPECT_LT((nodes.positions[i].z() > 0.0499 ? Vec3(f.x(), f.y(), 0) : f).norm(), 1e-12);
  }
  EXPECT_NEAR(total, traction * 4e-4, 1e-12);
  // Springs alone hold it: solved, not only checked.
  Vector u(k.rows());
  solve_statics(k, std::vector<bool>(static_cast<std::size_t>(k.rows()), false), force, u);
  EXPECT_LT((u - exact).lpNorm<Eigen::Infinity>(), 1e-10 * exact.lpNorm<Eigen::Infinity>());
}

TEST(Bedding, TextIsReadBack) {
  for (const char* text : {"2e5 half-space 0 0 -0.016 0 0 1", "1000 region tissue", " 3 box 0 0 0 1 1 1"}) {
    const Bedding b = parse_bedding(text);
    EXPECT_EQ(to_string(parse_bedding(to_string(b))), to_string(b));
  }
  EXPECT_EQ(parse_bedding("2e5 half-space 0 0 -16 0 0 1", 0.001).modulus, 2e5);  // N/m3 in any unit
  for (const char* text : {"", "box 0 0 0 1 1 1", "-1 box 0 0 0 1 1 1", "0 region a", "nan region a", "1e5",
                           "1e5 nowhere", "1e5x region a"})
    EXPECT_THROW(parse_bedding(text), Error) << text;
}

TEST(Bedding, WhatHoldsNothingIsNamed) {
  const TetMesh mesh = jittered_block({3, 3, 3});
  EXPECT_THROW(bedded_nodes(mesh, {parse_bedding("1e5 sphere 0 0 1 0.1")}), Error);  // takes nothing
  EXPECT_THROW(bedded_nodes(mesh, {parse_bedding("1e5 nodes 0,1")}), Error);         // no triangle
  EXPECT_THROW(anchored_nodes(mesh, {}), Error);
  const auto sprung = bedded_nodes(mesh, {parse_bedding("1e5 half-space 0 0 0.03 0 0 1")});
  const auto anchored = anchored_nodes(mesh, {}, sprung);  // springs are enough, and anchor nothing
  EXPECT_EQ(std::count(anchored.begin(), anchored.end(), 1), 0);
  EXPECT_EQ(std::count(sprung.begin(), sprung.end(), 1), 16);
}

}  // namespace
}  // namespace palpate::test
