#include "palpate/contact/projected_gradients.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "palpate/contact/complementarity.hpp"

namespace palpate {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// A problem in the solver's layout: rows of whole sixteens.
struct Problem {
  std::size_t n, ld;
  std::vector<float> a, b, lower, within, x, gradient, way, product, free, downhill;
  float norm = 0;
  SparseInverse inverse;

  Problem(const Matrix& matrix, const Eigen::VectorXd& linear, const Eigen::VectorXd& bound, double tolerance)
      : n(static_cast<std::size_t>(linear.size())),
        ld((n + 15) / 16 * 16),
        a(n * ld),
        b(n),
        lower(ld),
        within(ld),
        x(ld),
        gradient(ld),
        way(ld),
        product(ld),
        free(ld),
        downhill(ld),
        inverse(ld) {
    for (std::size_t i = 0; i < n; ++i) {
      float sum = 0;
      for (std::size_t j = 0; j < n; ++j)
        sum += std::abs(a[i * ld + j] = static_cast<float>(matrix(static_cast<int>(i), static_cast<int>(j))));
      norm = std::max(norm, sum);
      b[i] = static_cast<float>(linear[static_cast<int>(i)]);
      lower[i] = x[i] = static_cast<float>(bound[static_cast<int>(i)]);
      within[i] = static_cast<float>(tolerance);
    }
  }
  void precondition() {
    for (std::size_t i = 0; i < n; ++i) inverse.set(a.data(), ld, i);
  }
  int solve(int most = 500) {
    return minimise_over_bounds(a.data(), n, ld, norm, inverse, b, lower, within, x,
                                {gradient, way, product, free, downhill}, most);
  }
};

// Points on a square that press on each other as 1 / distance, like a half-space's: scaled to a diagonal
// of 1.
Matrix pressing(int side) {
  const int n = side * side;
  return Matrix::NullaryExpr(n, n, [&](Eigen::Index i, Eigen::Index j) {
    const double x = static_cast<double>(i / side - j / side), y = static_cast<double>(i % side - j % side);
    return i == j ? 1.0 : 0.3 / std::sqrt(x * x + y * y);
  });
}

TEST(ProjectedGradients, AgreesWithPivoting) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int side = 1; side <= 16; ++side)
    for (int trial = 0; trial < 10; ++trial) {
      const Matrix a = pressing(side);
      const int n = side * side;
      const Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(n, [&] { return normal(random) - 0.3; });
      Problem problem(a, b, Eigen::VectorXd::Zero(n), 1e-5);
      if (trial % 2 == 0) problem.precondition();
      const int products = problem.solve();
      ASSERT_GE(products, 0) << side;
      EXPECT_LE(products, 150) << side;
      std::vector<std::uint8_t> active(static_cast<std::size_t>(n), 0);
      std::vector<double> p(active.size()), matrix(active.size() * active.size()), vector(p.size());
      std::vector<std::int32_t> index(p.size());
      ASSERT_GT(solve_complementarity(a.data(), p.size(), p.size(), b.data(), active, p,
                                      {matrix, vector, index}, 1000),
                0);
      for (std::size_t i = 0; i < p.size(); ++i) EXPECT_NEAR(problem.x[i], p[i], 2e-3) << side;
    }
}

TEST(ProjectedGradients, ConditionsHoldFromAnyStartWithinTheBounds) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 200; ++trial) {
    const int n = 1 + trial % 70;
    const Matrix m = Matrix::NullaryExpr(n, n, [&] { return normal(random); });
    Matrix a = m * m.transpose() + Matrix::Identity(n, n) * n * 0.1;
    a /= a.diagonal().maxCoeff();
    const Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(n, [&] { return normal(random); });
    const Eigen::VectorXd lower = Eigen::VectorXd::NullaryExpr(n, [&] { return -std::abs(normal(random)); });
    Problem problem(a, b, lower, 1e-4);
    if (trial % 3 > 0) problem.precondition();
    for (std::size_t i = 0; i < problem.n; ++i)
      if (random() % 2) problem.x[i] += static_cast<float>(std::abs(normal(random)));
    ASSERT_GE(problem.solve(), 0) << trial;
    Eigen::VectorXd x(n);
    for (int i = 0; i < n; ++i) x[i] = static_cast<double>(problem.x[static_cast<std::size_t>(i)]);
    const Eigen::VectorXd g = a * x + b;
    for (int i = 0; i < n; ++i) {
      const auto low = static_cast<double>(problem.lower[static_cast<std::size_t>(i)]);
      EXPECT_GE(x[i], low);
      EXPECT_GE(g[i], -2e-4) << trial;
      EXPECT_LE(x[i] > low ? g[i] : 0.0, 2e-4) << trial;
    }
  }
}

// As in a tick: what most presses goes on pressing.
TEST(ProjectedGradients, APreconditionerHalvesTheProducts) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  int plain = 0, preconditioned = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const int n = 18 * 18;
    const Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(n, [&] { return normal(random); });
    Problem one(pressing(18), b, Eigen::VectorXd::Constant(n, -4), 1e-3), other = one;
    other.precondition();
    const int products = one.solve();
    ASSERT_GT(products, 0);
    plain += products, preconditioned += other.solve();
    for (std::size_t i = 0; i < one.n; ++i) ASSERT_NEAR(one.x[i], other.x[i], 1e-2);
  }
  EXPECT_LT(preconditioned, 0.6 * plain) << plain;
}

TEST(ProjectedGradients, SaysWhenItWasNotEnough) {
  Problem two_sides(Matrix{{1, -1}, {-1, 1}}, Eigen::VectorXd::Constant(2, -1), Eigen::VectorXd::Zero(2),
                    1e-6);
  two_sides.precondition();
  EXPECT_LT(two_sides.solve(), 0);  // no minimum: both grow for ever
  for (const float x : two_sides.x) EXPECT_GE(x, 0);
  Problem short_of(pressing(12), Eigen::VectorXd::Constant(144, -1), Eigen::VectorXd::Zero(144), 1e-6);
  EXPECT_LT(short_of.solve(3), 0);
  Problem no_number(Matrix{{1}}, Eigen::VectorXd::Constant(1, std::nan("")), Eigen::VectorXd::Zero(1), 1e-6);
  EXPECT_LT(no_number.solve(), 0);
}

}  // namespace
}  // namespace palpate
