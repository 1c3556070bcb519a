#include "palpate/contact/sparse_inverse.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

namespace palpate {
namespace {

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Matrix some(int n, std::mt19937& random) {
  std::normal_distribution<float> normal;
  const Matrix m = Matrix::NullaryExpr(n, n, [&] { return normal(random); });
  const Matrix a = m * m.transpose() + Matrix::Identity(n, n);
  const Eigen::VectorXf scale = a.diagonal().cwiseSqrt().cwiseInverse();
  return scale.asDiagonal() * a * scale.asDiagonal();
}

Matrix made_of(const Matrix& a) {
  const auto n = static_cast<std::size_t>(a.rows());
  SparseInverse inverse(n);
  for (std::size_t i = 0; i < n; ++i) inverse.set(a.data(), n, i);
  Matrix out(a.rows(), a.cols());
  for (int i = 0; i < a.rows(); ++i) {
    const Eigen::VectorXf unit = Eigen::VectorXf::Unit(a.rows(), i);
    Eigen::VectorXf z(a.rows());
    inverse.apply(n, unit.data(), z.data());
    out.col(i) = z;
  }
  return out;
}

TEST(SparseInverse, IsTheInverseWhereAllElementsHaveRoom) {
  std::mt19937 random(1);
  for (int n = 1; n <= static_cast<int>(SparseInverse::others) + 1; ++n)
    for (int trial = 0; trial < 20; ++trial) {
      const Matrix a = some(n, random);
      EXPECT_LT((made_of(a) * a - Matrix::Identity(n, n)).norm(), 1e-3f) << n;
    }
}

// Of a matrix whose inverse is as sparse: points on a line, each tied to the next.
TEST(SparseInverse, IsTheInverseOfAChain) {
  const int n = 40;
  const Matrix a = Matrix::NullaryExpr(n, n, [&](Eigen::Index i, Eigen::Index j) {
    return std::exp(-0.5f * static_cast<float>(std::abs(i - j)));
  });
  EXPECT_LT((made_of(a) * a - Matrix::Identity(n, n)).norm(), 1e-3f);
}

// Also of the points of a node that two instruments touch, and where a slot has no point.
TEST(SparseInverse, IsPositiveDefiniteWhateverTheElements) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 50; ++trial) {
    Matrix a = some(12, random);
    a.row(7) = -a.row(3), a.col(7) = -a.col(3), a(7, 7) = 1, a(7, 3) = a(3, 7) = -1;
    a.row(9).setZero(), a.col(9).setZero(), a(9, 9) = 1;
    const Matrix inverse = made_of(a);
    EXPECT_LT((inverse - inverse.transpose()).norm(), 1e-3f * inverse.norm());
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix>(inverse).eigenvalues().minCoeff(), 1e-3f);
    EXPECT_LT(inverse.norm(), 1e3f);
    EXPECT_EQ(inverse(9, 9), 1);
  }
}

}  // namespace
}  // namespace palpate
