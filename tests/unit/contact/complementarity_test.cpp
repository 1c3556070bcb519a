#include "palpate/contact/complementarity.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "palpate/contact/dense_cholesky.hpp"

namespace palpate {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Matrix random_spd(int n, std::mt19937& random, double floor) {
  std::normal_distribution<double> normal;
  const Matrix m = Matrix::NullaryExpr(n, n, [&] { return normal(random); });
  return m * m.transpose() + floor * Matrix::Identity(n, n);
}

TEST(DenseCholesky, AgreesWithEigenAtEverySize) {
  std::mt19937 random(1);
  for (int n = 1; n < 40; ++n) {
    const Matrix a = random_spd(n, random, 0.1);
    const Eigen::VectorXd b = Eigen::VectorXd::Random(n);
    Matrix u = a;
    ASSERT_TRUE(cholesky(u.data(), static_cast<std::size_t>(n), static_cast<std::size_t>(n)));
    Eigen::VectorXd x = b;
    cholesky_solve(u.data(), static_cast<std::size_t>(n), static_cast<std::size_t>(n), x.data());
    EXPECT_LT((a * x - b).norm(), 1e-9 * b.norm()) << n;
    EXPECT_LT((x - a.llt().solve(b)).norm(), 1e-8 * x.norm()) << n;
  }
}

TEST(DenseCholesky, RefusesWhatIsNotPositiveDefinite) {
  for (const std::size_t n : {1u, 3u, 9u}) {
    Matrix a = -Matrix::Identity(static_cast<int>(n), static_cast<int>(n));
    EXPECT_FALSE(cholesky(a.data(), n, n));
    a.setConstant(std::nan(""));
    EXPECT_FALSE(cholesky(a.data(), n, n));
  }
}

// Complementarity is its own check: p >= 0, w >= 0, p.w = 0 has one solution for a positive definite matrix.
TEST(Complementarity, ConditionsHoldOnRandomAndIllConditionedSystems) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 300; ++trial) {
    const int n = 1 + trial % 60;
    const Matrix a = random_spd(n, random, trial % 3 == 0 ? 1e-6 : 0.1);
    Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(n, [&] { return normal(random); });
    if (trial % 7 == 0) b.setConstant(-1);
    std::vector<std::uint8_t> active(static_cast<std::size_t>(n));
    for (auto& x : active) x = static_cast<std::uint8_t>(random() % 2);
    std::vector<double> p(static_cast<std::size_t>(n)), matrix(static_cast<std::size_t>(n * n)),
        vector(p.size());
    std::vector<std::int32_t> index(p.size());
    ASSERT_GT(solve_complementarity(a.data(), p.size(), p.size(), b.data(), active, p,
                                    {matrix, vector, index}, 1000),
              0)
        << trial;
    const Eigen::Map<Eigen::VectorXd> x(p.data(), n);
    const Eigen::VectorXd w = a * x + b;
    const double scale = b.cwiseAbs().maxCoeff();
    EXPECT_GE(x.minCoeff(), 0);
    EXPECT_GE(w.minCoeff(), -1e-7 * scale);
    EXPECT_LE(std::abs(x.dot(w)), 1e-7 * scale * (1 + x.lpNorm<1>()));
  }
}

// Bilateral rows: w = 0 there, p of any sign, whatever the others do.
TEST(Complementarity, BilateralRows) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  int pulling = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const int n = 2 + trial % 40;
    const Matrix a = random_spd(n, random, 0.1);
    const Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(n, [&] { return normal(random); });
    std::vector<std::uint8_t> active(static_cast<std::size_t>(n)), given,
        factored(active.size(), not_factored);
    for (auto& x : active) x = static_cast<std::uint8_t>(random() % 3);
    given = active;
    std::vector<double> p(active.size()), matrix(active.size() * active.size()), vector(p.size());
    std::vector<std::int32_t> index(p.size());
    for (int again = 0; again < 2; ++again) {
      ASSERT_GT(solve_complementarity(a.data(), p.size(), p.size(), b.data(), active, p,
                                      {matrix, vector, index, factored}, 1000),
                0)
          << trial;
      const Eigen::VectorXd w = a * Eigen::Map<Eigen::VectorXd>(p.data(), n) + b;
      for (int i = 0; i < n; ++i) {
        const auto k = static_cast<std::size_t>(i);
        EXPECT_EQ(active[k] == bilateral, given[k] == bilateral);
        EXPECT_TRUE(given[k] == bilateral || p[k] >= 0);
        EXPECT_GE(w[i], -1e-7);
        if (given[k] == bilateral || p[k] > 0) {
          EXPECT_LT(std::abs(w[i]), 1e-7);
        }
        pulling += p[k] < 0;
      }
    }
  }
  EXPECT_GT(pulling, 200);
}

}  // namespace
}  // namespace palpate
