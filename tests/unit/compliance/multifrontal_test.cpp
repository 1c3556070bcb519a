#include "palpate/compliance/multifrontal.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <numeric>
#include <string>

#include "palpate/base/error.hpp"
#include "palpate/compliance/ordering.hpp"
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

}  // namespace
}  // namespace palpate
