// The compliance of elastic bodies.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <numeric>

#include "palpate/compliance/multifrontal.hpp"
#include "palpate/compliance/ordering.hpp"
#include "palpate/compliance/symbolic.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "palpate/geometry/shapes.hpp"
#include "unit/compliance/systems.hpp"

namespace palpate {
namespace {

struct Body {
  Sparse stiffness;  // of all nodes
  std::vector<std::uint8_t> anchored;
  std::vector<Index> surface;  // free nodes on the surface, mesh numbering
};

// A block of 10 cm, its base held; materials of the lower and the upper half.
Body make_body(const std::array<int, 3>& cells, const Material& lower, const Material& upper) {
  TetMesh mesh = make_block({Vec3::Zero(), Vec3::Constant(0.1)}, cells);
  mesh.region_names = {"lower", "upper"};
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    double z = 0;
    for (const Index node : mesh.tets[t]) z += mesh.nodes[static_cast<std::size_t>(node)].z() / 4;
    mesh.regions[t] = z > 0.05;
  }
  Body body;
  body.stiffness = assemble_stiffness(mesh, {lower, upper});
  for (const Vec3& x : mesh.nodes) body.anchored.push_back(x.z() < 1e-6);
  for (const Index node : boundary(mesh).nodes)
    if (!body.anchored[static_cast<std::size_t>(node)]) body.surface.push_back(node);
  return body;
}

template <class Scalar>
Eigen::MatrixXd compliance(const Body& body, int threads = 1) {
  const FreeStiffness free = remove_anchored(body.stiffness, body.anchored);
  std::vector<Index> nodes;
  for (const Index node : body.surface) nodes.push_back(free.free_of[static_cast<std::size_t>(node)]);
  const auto s = static_cast<Eigen::Index>(3 * nodes.size());
  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> c(s, s);
  const Cholesky factor(free.matrix, nested_dissection(free.matrix), threads);
  compliance_sweep<Scalar>(factor, nodes, std::span<Scalar>(c.data(), static_cast<std::size_t>(c.size())),
                           threads);
  return c.template cast<double>();
}

// T 5.1.3: rows and columns of the anchor set to those of the identity, everything inverted, the surface
// taken.
Eigen::MatrixXd thesis_inverse(const Body& body) {
  Eigen::MatrixXd k(body.stiffness);
  for (Eigen::Index i = 0; i < k.rows(); ++i)
    if (body.anchored[static_cast<std::size_t>(i / 3)]) {
      k.row(i).setZero(), k.col(i).setZero();
      k(i, i) = 1;
    }
  const Eigen::MatrixXd inverse = k.inverse();
  const auto s = static_cast<Eigen::Index>(3 * body.surface.size());
  return Eigen::MatrixXd::NullaryExpr(s, s, [&](Eigen::Index i, Eigen::Index j) {
    return inverse(3 * body.surface[static_cast<std::size_t>(i / 3)] + i % 3,
                   3 * body.surface[static_cast<std::size_t>(j / 3)] + j % 3);
  });
}

TEST(ElasticCompliance, IsTheThesisInverse) {
  const Body body = make_body({4, 4, 5}, {1e4, 0.45, 1000}, {3e4, 0.3, 1000});
  const Eigen::MatrixXd expected = thesis_inverse(body), c = compliance<double>(body);
  EXPECT_LT(scaled_error(c, expected), 1e-10);
  EXPECT_EQ(c, c.transpose());
  EXPECT_EQ(Eigen::LLT<Eigen::MatrixXd>(c).info(), Eigen::Success) << "positive definite";
}

TEST(ElasticCompliance, FloatIsGoodTo1e6AndPositiveDefinite) {
  const Body body = make_body({7, 7, 7}, {1e4, 0.45, 1000}, {1e4, 0.45, 1000});
  const Eigen::MatrixXd exact = compliance<double>(body), c = compliance<float>(body, 2);
  EXPECT_LT(scaled_error(c, exact), 1e-6);
  EXPECT_EQ(c, c.transpose());
  EXPECT_EQ(Eigen::LLT<Eigen::MatrixXd>(c).info(), Eigen::Success);
}

// A stone a million times stiffer than what it rests on, and the other way round.
TEST(ElasticCompliance, ContrastOfAMillion) {
  for (const auto& [lower, upper] : {std::pair(1e4, 1e10), std::pair(1e10, 1e4)}) {
    const Body body = make_body({4, 4, 4}, {lower, 0.45, 1000}, {upper, 0.3, 1000});
    const Eigen::MatrixXd exact = thesis_inverse(body);
    EXPECT_LT(scaled_error(compliance<double>(body), exact), 1e-7);
    EXPECT_LT(scaled_error(compliance<float>(body), exact), 1e-6);
  }
}

TEST(ElasticCompliance, EveryOrderAndAmalgamationGivesTheSame) {
  constexpr Index all = 1000;
  for (const auto& [contrast, tolerance] : {std::pair(1.0, 1e-12), std::pair(1e6, 1e-7)}) {
    const Body body = make_body({4, 4, 4}, {1e4, 0.3, 1000}, {contrast * 1e4, 0.3, 1000});
    const FreeStiffness free = remove_anchored(body.stiffness, body.anchored);
    std::vector<Index> nodes, up(static_cast<std::size_t>(free.matrix.cols()) / 3);
    for (const Index node : body.surface) nodes.push_back(free.free_of[static_cast<std::size_t>(node)]);
    std::iota(up.begin(), up.end(), 0);
    const auto s = static_cast<Eigen::Index>(3 * nodes.size());
    const auto sweep = [&](const std::vector<Index>& order, std::span<const Relaxation> relaxation) {
      Eigen::MatrixXd c(s, s);
      compliance_sweep<double>(Cholesky(free.matrix, analyse(node_graph(free.matrix), order, relaxation)),
                               nodes, std::span<double>(c.data(), static_cast<std::size_t>(c.size())), 1);
      return c;
    };
    const std::vector<Index> down(up.rbegin(), up.rend()), dissection = nested_dissection(free.matrix);
    const Eigen::MatrixXd expected = sweep(dissection, default_relaxation());
    const std::vector<Relaxation> none, some = {{8, 0.5}, {16, 0.2}}, one_front = {{all, 1}};
    for (const auto& order : {up, down, dissection})
      for (const auto& relaxation : {none, some, one_front})
        EXPECT_LT(scaled_error(sweep(order, relaxation), expected), tolerance) << contrast;
  }
}

TEST(ElasticCompliance, WithoutAnchorThereIsNone) {
  for (const double poisson : {0.0, 0.3, 0.499}) {
    Body body = make_body({6, 6, 6}, {1e4, poisson, 1000}, {1e7, poisson, 1000});
    std::fill(body.anchored.begin(), body.anchored.end(), std::uint8_t{0});
    try {
      compliance<float>(body);
      ADD_FAILURE() << "nu " << poisson;
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::physics);
      EXPECT_NE(std::string(e.what()).find("anchor"), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace palpate
