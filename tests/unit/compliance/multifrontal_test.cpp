#include "palpate/compliance/multifrontal.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <atomic>
#include <limits>
#include <numeric>
#include <string>

#include "palpate/base/error.hpp"
#include "palpate/compliance/ordering.hpp"
#include "palpate/compliance/symbolic.hpp"
#include "unit/compliance/systems.hpp"

namespace palpate {
namespace {

template <class Scalar>
using Dense = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::vector<Index> natural(Index n) {
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  return order;
}

template <class T>
std::vector<T> shuffled(std::vector<T> values, unsigned seed) {
  std::mt19937 random(seed);
  std::shuffle(values.begin(), values.end(), random);
  return values;
}

// Some of the nodes, out of order.
std::vector<Index> some_nodes(Index n, std::size_t count, unsigned seed) {
  std::vector<Index> nodes = shuffled(natural(n), seed);
  nodes.resize(count);
  return nodes;
}

Dense<double> inverse_between(const Sparse& a, const std::vector<Index>& nodes) {
  const Eigen::MatrixXd inverse =
      Eigen::MatrixXd(a).llt().solve(Eigen::MatrixXd::Identity(a.rows(), a.cols()));
  const auto s = static_cast<Eigen::Index>(3 * nodes.size());
  return Dense<double>::NullaryExpr(s, s, [&](Eigen::Index i, Eigen::Index j) {
    return inverse(3 * nodes[static_cast<std::size_t>(i / 3)] + i % 3,
                   3 * nodes[static_cast<std::size_t>(j / 3)] + j % 3);
  });
}

template <class Scalar>
Dense<Scalar> sweep(const Sparse& a, const std::vector<Index>& order, const std::vector<Index>& nodes,
                    int threads = 1) {
  const auto s = static_cast<Eigen::Index>(3 * nodes.size());
  Dense<Scalar> c = Dense<Scalar>::Constant(s, s, std::numeric_limits<Scalar>::quiet_NaN());
  const Cholesky factor(a, order, threads);
  compliance_sweep<Scalar>(factor, nodes, std::span<Scalar>(c.data(), static_cast<std::size_t>(c.size())),
                           threads);
  return c;
}

void check_system(const Sparse& a, const std::vector<Index>& nodes, const std::string& what) {
  const Dense<double> expected = inverse_between(a, nodes);
  const auto n = static_cast<Index>(a.rows() / 3);
  const std::vector<Index> up = natural(n), down(up.rbegin(), up.rend());
  for (const auto& order : {up, down, shuffled(up, 7), nested_dissection(a)}) {
    const Dense<double> c = sweep<double>(a, order, nodes);
    EXPECT_LT(scaled_error(c, expected), 1e-12) << what;
    EXPECT_EQ(c, c.transpose()) << what;
    EXPECT_LT(scaled_error(sweep<float>(a, order, nodes), expected), 2e-6) << what;
  }
}

TEST(Multifrontal, ComplianceIsTheInverseForEveryOrder) {
  check_system(random_system(1, {}, 1), {0}, "one node");
  check_system(random_system(2, {}, 1), {1, 0}, "two nodes apart");
  check_system(random_system(30, random_edges(30, 20, 3), 3), some_nodes(30, 12, 4), "loose pieces");
  check_system(random_system(60, random_edges(60, 600, 5), 5), some_nodes(60, 60, 6), "nearly full");
  check_system(random_system(343, grid_edges(7, 7, 7), 8), some_nodes(343, 100, 9), "grid");
  check_system(random_system(300, grid_edges(300, 1, 1), 8), some_nodes(300, 250, 9), "chain");
  check_system(random_system(240, grid_edges(2, 3, 40), 8), natural(240), "beam, all nodes");
}

TEST(Multifrontal, SolveIsTheInverse) {
  const Sparse a = random_system(200, grid_edges(5, 5, 8), 2);
  const Cholesky factor(a, nested_dissection(a));
  const Eigen::MatrixXd b = Eigen::MatrixXd::Random(600, 7);
  Eigen::MatrixXd x = b;
  factor.solve({x.data(), 4200}, 7);
  EXPECT_LT((a * x - b).norm(), 1e-12 * b.norm());
  EXPECT_THROW(factor.solve({x.data(), 4199}, 7), Error);
}

TEST(Multifrontal, EveryAmalgamationGivesTheSame) {
  const Sparse a = random_system(343, grid_edges(7, 7, 7), 8);
  const std::vector<Index> nodes = some_nodes(343, 120, 9), order = nested_dissection(a);
  const Dense<double> expected = inverse_between(a, nodes);
  constexpr Index all = 1000;
  std::size_t most = 0, least = 1000;
  for (const std::vector<Relaxation>& relaxation : std::vector<std::vector<Relaxation>>{
           {}, {{4, 0.3}}, {{8, 0.5}, {16, 0.2}}, {{all, 0.0}}, {{all, 0.2}}, {{all, 0.6}}, {{all, 1}}}) {
    const Cholesky factor(a, analyse(node_graph(a), order, relaxation));
    most = std::max(most, factor.stats().supernodes), least = std::min(least, factor.stats().supernodes);
    Dense<double> c(360, 360);
    compliance_sweep<double>(factor, nodes, std::span<double>(c.data(), 360 * 360));
    EXPECT_LT(scaled_error(c, expected), 1e-12) << factor.stats().supernodes;
  }
  EXPECT_EQ(least, 1u);
  EXPECT_GT(most, 100u);
}

// Large enough for subtrees as tasks, tiled fronts and several panels of Y.
TEST(Multifrontal, SameBitsForAnyNumberOfThreads) {
  const Sparse a = random_system(5832, grid_edges(18, 18, 18), 4);
  const std::vector<Index> order = nested_dissection(a), nodes = some_nodes(5832, 900, 5);
  const Dense<float> one = sweep<float>(a, order, nodes, 1);
  EXPECT_TRUE(one.allFinite());
  EXPECT_EQ(one, sweep<float>(a, order, nodes, 2));
  EXPECT_EQ(one, sweep<float>(a, order, nodes, 5));
}

TEST(Multifrontal, ForcePatterns) {
  constexpr Index n = 125;
  const Sparse a = random_system(n, grid_edges(5, 5, 5), 3);
  const std::vector<std::array<Index, 2>> edges = grid_edges(5, 5, 5);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Eigen::MatrixXd r = Eigen::MatrixXd::Zero(3 * n, 60);
  for (Index j = 0; j < 20; ++j)  // each load is on the two nodes of an edge
    for (const Index node : edges[static_cast<std::size_t>(13 * j)])
      r.block<3, 3>(3 * node, 3 * j) = Mat3::NullaryExpr([&] { return uniform(random); });
  const Dense<double> expected = r.transpose() * Eigen::MatrixXd(a).llt().solve(r);
  const Cholesky factor(a, nested_dissection(a));
  Dense<double> c(60, 60);
  compliance_sweep<double>(factor, Sparse(r.sparseView()), std::span<double>(c.data(), 3600));
  EXPECT_LT(scaled_error(c, expected), 1e-12);

  const Sparse chain = random_system(300, grid_edges(300, 1, 1), 3);
  const Cholesky chain_factor(chain, nested_dissection(chain));
  Sparse apart(900, 3);
  for (int k = 0; k < 3; ++k) apart.insert(k, k) = 1, apart.insert(897 + k, k) = 1;
  std::vector<double> out(9);
  EXPECT_THROW(compliance_sweep<double>(chain_factor, apart, std::span<double>(out)), Error);
  EXPECT_THROW(compliance_sweep<double>(chain_factor, Sparse(900, 3), std::span<double>(out)), Error);
}

TEST(Multifrontal, WrongNodesAreErrors) {
  const Sparse a = random_system(5, grid_edges(5, 1, 1), 1);
  const Cholesky factor(a, natural(5));
  std::vector<double> out(36);
  for (const std::vector<Index>& nodes : {std::vector<Index>{1, 1}, {0, 5}, {-1, 2}, {1, 2, 3}})
    EXPECT_THROW(compliance_sweep<double>(factor, nodes, std::span<double>(out)), Error);
  compliance_sweep<double>(factor, std::vector<Index>{}, std::span<double>());
  for (const std::vector<Index>& order : {std::vector<Index>{0, 1, 2, 3}, {0, 1, 2, 3, 3}, {0, 1, 2, 3, 5}})
    EXPECT_THROW(Cholesky(a, order), Error);
}

std::string failure(const Sparse& a, int threads = 1) {
  try {
    const Cholesky factor(a, nested_dissection(a), threads);
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::physics);
    return e.what();
  }
  return "";
}

TEST(Multifrontal, BadPivotsNameTheNode) {
  Sparse a = random_system(64, {}, 1);
  a.coeffRef(3 * 17 + 1, 3 * 17 + 1) = -1;
  EXPECT_NE(failure(a).find("node 17:"), std::string::npos) << failure(a);
  a.coeffRef(3 * 17 + 1, 3 * 17 + 1) = 0;
  EXPECT_NE(failure(a).find("node 17:"), std::string::npos) << failure(a);
  a.coeffRef(3 * 17 + 1, 3 * 17 + 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(failure(a).find("node 17:"), std::string::npos) << failure(a);

  // Two bodies, the second (nodes 125 .. 249) not held: one of its nodes is named.
  std::vector<std::array<Index, 2>> edges = grid_edges(5, 5, 5);
  for (const auto& [i, j] : grid_edges(5, 5, 5)) edges.push_back({i + 125, j + 125});
  Sparse two = random_system(250, edges, 2, 0);
  for (int k = 0; k < 3; ++k) two.coeffRef(k, k) += 1;
  const std::string text = failure(two), key = "free node ";
  ASSERT_NE(text.find(key), std::string::npos) << text;
  EXPECT_GE(std::stoi(text.substr(text.find(key) + key.size())), 125) << text;
  EXPECT_EQ(failure(two, 2).substr(0, 20), text.substr(0, 20));
}

TEST(Multifrontal, ProgressGrowsToOneAndInterrupts) {
  const Sparse a = random_system(343, grid_edges(7, 7, 7), 8);
  double last = 0;
  Progress progress;
  progress.report = [&](double f) {
    EXPECT_GE(f, last);
    last = f;
  };
  const Cholesky factor(a, nested_dissection(a), 2, progress);
  EXPECT_EQ(last, 1);
  last = 0;
  const std::vector<Index> nodes = natural(343);
  std::vector<float> c(1029 * 1029);
  compliance_sweep<float>(factor, nodes, std::span<float>(c), 2, progress);
  EXPECT_EQ(last, 1);

  const std::atomic<bool> stop{true};
  const Progress stopped{{}, &stop};
  EXPECT_THROW(Cholesky(a, nested_dissection(a), 2, stopped), Error);
  EXPECT_THROW(compliance_sweep<float>(factor, nodes, std::span<float>(c), 2, stopped), Error);
}

// Any graph, any loads, any order.
RC_GTEST_PROP(Multifrontal, RandomSystems, ()) {
  const auto n = static_cast<Index>(*rc::gen::inRange(1, 60));
  const auto seed = *rc::gen::arbitrary<unsigned>();
  const Sparse a = random_system(n, random_edges(n, *rc::gen::inRange(0, 5 * n), seed), seed);
  const auto nodes = some_nodes(n, static_cast<std::size_t>(*rc::gen::inRange<Index>(1, n + 1)), seed);
  const std::vector<Index> order = shuffled(natural(n), seed + 1);
  RC_ASSERT(scaled_error(sweep<double>(a, order, nodes, 2), inverse_between(a, nodes)) < 1e-12);
}

}  // namespace
}  // namespace palpate
