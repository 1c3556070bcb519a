#include "palpate/elasticity/mass.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "palpate/elasticity/stiffness.hpp"
#include "support/meshes.hpp"

namespace palpate {
namespace {

// Fields in the elements' space: the integral of density u v, by Gauss over the block, exact to degree five.
TEST(Mass, IntegratesProductsOfFields) {
  const TetMesh mesh = test::jittered_block({3, 3, 2});
  const Box box{Vec3(0.01, -0.02, 0.03), Vec3(0.07, 0.03, 0.07)};
  const std::array<double, 3> at{-std::sqrt(0.6), 0, std::sqrt(0.6)}, weight{5.0 / 18, 8.0 / 18, 5.0 / 18};
  for (const int order : {1, 2}) {
    const ElementNodes nodes = element_nodes(mesh, order);
    const auto u = [&](const Vec3& p) {
      return order == 1 ? 1 + 9 * p.x() - 4 * p.z() : p.x() * p.y() + 3 * p.z();
    };
    const auto v = [&](const Vec3& p) { return order == 1 ? 2 - p.y() : p.z() * p.z() - p.x() + 0.1; };
    Eigen::VectorXd a(static_cast<Eigen::Index>(nodes.size())), b = a;
    for (std::size_t i = 0; i < nodes.size(); ++i)
      a[static_cast<Eigen::Index>(i)] = u(nodes.positions[i]),
      b[static_cast<Eigen::Index>(i)] = v(nodes.positions[i]);
    double expected = 0;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t k = 0; k < 3; ++k) {
          const Vec3 p = box.center() + 0.5 * box.size().cwiseProduct(Vec3(at[i], at[j], at[k]));
          expected += 1060 * box.size().prod() * weight[i] * weight[j] * weight[k] * u(p) * v(p);
        }
    const Eigen::SparseMatrix<double> m = assemble_mass(mesh, nodes, {{1e4, 0.45, 1060}});
    EXPECT_NEAR(a.dot(m * b), expected, 1e-12 * std::abs(expected)) << order;
    EXPECT_EQ(Eigen::MatrixXd(m.triangularView<Eigen::Upper>()),
              Eigen::MatrixXd(Eigen::SparseMatrix<double>(m.transpose()).triangularView<Eigen::Upper>()));
    EXPECT_EQ(Eigen::LLT<Eigen::MatrixXd>(Eigen::MatrixXd(m)).info(), Eigen::Success);
  }
}

// A bar fixed at one end swings along itself at sqrt(E / density) / 4 L (nu = 0).
TEST(Mass, WithStiffnessGivesTheFrequencyOfABar) {
  const TetMesh mesh = make_block({Vec3::Zero(), Vec3(0.01, 0.01, 0.1)}, {1, 1, 10});
  const Material material{1e4, 0, 1000};
  for (const int order : {1, 2}) {
    const ElementNodes nodes = element_nodes(mesh, order);
    const auto size = static_cast<Eigen::Index>(3 * nodes.size());
    Eigen::VectorXd u(size);
    for (std::size_t i = 0; i < nodes.size(); ++i)
      u.segment<3>(static_cast<Eigen::Index>(3 * i)) =
          Vec3(0, 0, std::sin(M_PI / 0.2 * nodes.positions[i].z()));
    const double stiff = u.dot(assemble_stiffness(mesh, nodes, {material}) * u);
    const Eigen::SparseMatrix<double> m = assemble_mass(mesh, nodes, {material});
    Eigen::VectorXd along(static_cast<Eigen::Index>(nodes.size()));
    for (Eigen::Index i = 0; i < along.size(); ++i) along[i] = u[3 * i + 2];
    const double omega = std::sqrt(stiff / along.dot(m * along)), exact = M_PI / 0.2 * std::sqrt(10.0);
    EXPECT_NEAR(omega, exact, (order == 1 ? 5e-3 : 1e-5) * exact) << order;
  }
}

}  // namespace
}  // namespace palpate
