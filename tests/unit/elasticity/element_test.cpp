// The stiffness of one tetrahedron against other ways to get it.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "palpate/base/error.hpp"
#include "palpate/elasticity/stiffness.hpp"

namespace palpate {
namespace {

using Corners = std::array<Vec3, 4>;

// Random tetrahedra of a few centimetres, right-handed, not flat.
std::vector<Corners> some_tets() {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> in(-0.03, 0.03);
  std::vector<Corners> tets;
  while (tets.size() < 50) {
    Corners x;
    for (Vec3& p : x) p = Vec3(in(random) + 0.2, in(random), in(random));
    const double six = (x[1] - x[0]).cross(x[2] - x[0]).dot(x[3] - x[0]);
    if (six < 0) std::swap(x[2], x[3]);
    if (std::abs(six) > 1e-6) tets.push_back(x);
  }
  return tets;
}

Mat3 edges(const Corners& x) { return (Mat3() << x[1] - x[0], x[2] - x[0], x[3] - x[0]).finished(); }

double energy(const Corners& x, const Material& m, const Eigen::Matrix<double, 12, 1>& u) {
  Corners moved = x;
  for (std::size_t i = 0; i < 4; ++i) moved[i] += u.segment<3>(static_cast<Eigen::Index>(3 * i));
  const Mat3 gradient = edges(moved) * edges(x).inverse() - Mat3::Identity();
  const Mat3 e = 0.5 * (gradient + gradient.transpose());
  return edges(x).determinant() / 6 * (0.5 * m.lambda() * e.trace() * e.trace() + m.mu() * e.squaredNorm());
}

// The energy is quadratic: its second differences are exact for any step.
TEST(Element, IsTheSecondDifferenceOfTheStrainEnergy) {
  const Material m{10e3, 0.4};
  for (const Corners& x : some_tets()) {
    const auto k = element_stiffness_p1(x, m);
    const double step = 0.01;
    for (int i = 0; i < 12; ++i)
      for (int j = 0; j < 12; ++j) {
        const Eigen::Matrix<double, 12, 1> a = step * Eigen::Matrix<double, 12, 1>::Unit(i),
                                           b = step * Eigen::Matrix<double, 12, 1>::Unit(j);
        const double second = (energy(x, m, a + b) - energy(x, m, a) - energy(x, m, b)) / (step * step);
        EXPECT_NEAR(k(i, j), second, 1e-11 * k.cwiseAbs().maxCoeff());
      }
    EXPECT_TRUE(k == k.transpose());
  }
}

// T 2.1: gradients of the barycentric coordinates as minors of the matrix of corners, signs alternating from
// corner to corner; strains and stresses in Voigt's notation, volume by a quadrature of four points.
TEST(Element, IsTheIntegralOfTheTextbook) {
  const Material m{7e3, 0.3};
  Eigen::Matrix<double, 6, 6> elastic = Eigen::Matrix<double, 6, 6>::Zero();
  elastic.topLeftCorner<3, 3>().setConstant(m.poisson);
  elastic.diagonal() << 1 - m.poisson, 1 - m.poisson, 1 - m.poisson, 0.5 - m.poisson, 0.5 - m.poisson,
      0.5 - m.poisson;
  elastic *= m.young / ((1 + m.poisson) * (1 - 2 * m.poisson));
  for (const Corners& x : some_tets()) {
    Eigen::Matrix4d corners;
    for (int i = 0; i < 4; ++i) corners.col(i) << 1, x[static_cast<std::size_t>(i)];
    const double six_volume = corners.determinant();
    Eigen::Matrix<double, 6, 12> b = Eigen::Matrix<double, 6, 12>::Zero();
    for (int i = 0; i < 4; ++i) {
      Vec3 g;
      for (int a = 0; a < 3; ++a) {
        Mat3 minor;
        for (int row = 0, r = 0; row < 4; ++row) {
          if (row == a + 1) continue;
          for (int column = 0, c = 0; column < 4; ++column)
            if (column != i) minor(r, c++) = corners(row, column);
          ++r;
        }
        g[a] = ((a + 1 + i) % 2 ? -1 : 1) * minor.determinant() / six_volume;
      }
      b.block<6, 3>(0, 3 * i) << g[0], 0, 0, 0, g[1], 0, 0, 0, g[2], g[1], g[0], 0, 0, g[2], g[1], g[2], 0,
          g[0];
    }
    Eigen::Matrix<double, 12, 12> integral = Eigen::Matrix<double, 12, 12>::Zero();
    for (int point = 0; point < 4; ++point) integral += six_volume / 24 * b.transpose() * elastic * b;
    const auto k = element_stiffness_p1(x, m);
    EXPECT_LT((k - integral).cwiseAbs().maxCoeff(), 1e-11 * k.cwiseAbs().maxCoeff());
  }
}

TEST(Element, FlatOrInvertedIsAnError) {
  const Corners flat{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(1, 1, 0)};
  const Corners inverted{Vec3(0, 0, 0), Vec3(0, 1, 0), Vec3(1, 0, 0), Vec3(0, 0, 1)};
  EXPECT_THROW(element_stiffness_p1(flat, {1e4, 0.3}), Error);
  EXPECT_THROW(element_stiffness_p1(inverted, {1e4, 0.3}), Error);
}

}  // namespace
}  // namespace palpate
