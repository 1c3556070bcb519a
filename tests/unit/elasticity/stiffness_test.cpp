#include "palpate/elasticity/stiffness.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <numeric>
#include <random>

#include "palpate/base/error.hpp"
#include "palpate/elasticity/anchor.hpp"
#include "support/meshes.hpp"
#include "support/statics.hpp"

namespace palpate::test {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Dense = Eigen::MatrixXd;
const Material tissue{10e3, 0.45};

Mat3 some_gradient() {
  return (Mat3() << 0.011, -0.004, 0.007, 0.002, -0.013, 0.005, -0.006, 0.009, 0.003).finished();
}

std::vector<Vec3> linear_field(const std::vector<Vec3>& positions, const Mat3& gradient) {
  std::vector<Vec3> u;
  for (const Vec3& p : positions) u.push_back(gradient * p + Vec3(0.001, -0.002, 0.003));
  return u;
}

// Of the nodes on the boundary; a middle is there where it lies on a side of the box of the jittered block.
std::vector<bool> boundary_unknowns(const TetMesh& mesh, const ElementNodes& nodes) {
  const Box inside = bounding_box(mesh.nodes).grown(-1e-9);
  std::vector<bool> fixed;
  for (const Vec3& p : nodes.positions) fixed.insert(fixed.end(), 3, !inside.contains(p));
  return fixed;
}

class Orders : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Stiffness, Orders, testing::Values(1, 2));

TEST_P(Orders, PatchTest) {
  for (const double poisson : {0.0, 0.3, 0.45, 0.499}) {
    const TetMesh mesh = GetParam() == 1 ? jittered_block({6, 5, 4}) : jittered_block({4, 3, 3});
    const ElementNodes nodes = element_nodes(mesh, GetParam());
    const Material material{10e3, poisson};
    const Vector exact = flat(linear_field(nodes.positions, some_gradient()));
    Vector u = exact;
    solve_statics(assemble_stiffness(mesh, nodes, {material}), boundary_unknowns(mesh, nodes),
                  Vector::Zero(exact.size()), u);
    EXPECT_LT((u - exact).lpNorm<Eigen::Infinity>(), 1e-12 * exact.lpNorm<Eigen::Infinity>()) << poisson;
    const Mat3 strain = 0.5 * (some_gradient() + some_gradient().transpose());
    const auto stress = [&](const Mat3& e) {
      return Mat3(material.lambda() * e.trace() * Mat3::Identity() + 2 * material.mu() * e);
    };
    // Rounding of u is divided by a cell and multiplied by lambda, which grows as 1 / (1 - 2 nu).
    const double scale = (material.lambda() + 2 * material.mu()) * strain.norm();
    std::vector<Vec3> corners = unflat(u);
    corners.resize(mesh.nodes.size());
    for (const Mat3& e : strains(mesh, corners))
      EXPECT_LT((stress(e) - stress(strain)).norm(), 1e-11 * scale);
  }
}

TEST_P(Orders, MaterialsOfTetrahedraOrOfRegions) {
  const TetMesh mesh = graded_bracket(4);
  const ElementNodes nodes = element_nodes(mesh, GetParam());
  const std::vector<Material> of_regions{tissue, {20e3, 0.3}, {1e6, 0.49}};
  std::vector<Material> of_tets;
  for (const Index r : mesh.regions) of_tets.push_back(of_regions[static_cast<std::size_t>(r)]);
  EXPECT_EQ(Dense(assemble_stiffness(mesh, nodes, of_tets)),
            Dense(assemble_stiffness(mesh, nodes, of_regions)));
  of_tets[3].young *= 2;
  EXPECT_NE(Dense(assemble_stiffness(mesh, nodes, of_tets)),
            Dense(assemble_stiffness(mesh, nodes, of_regions)));
  of_tets[3].poisson = 0.5;
  EXPECT_THROW(assemble_stiffness(mesh, nodes, of_tets), Error);
  of_tets.pop_back();
  EXPECT_THROW(assemble_stiffness(mesh, nodes, of_tets), Error);
}

TEST_P(Orders, RigidMotionsGiveNoForce) {
  const TetMesh mesh = graded_bracket(8);
  const ElementNodes nodes = element_nodes(mesh, GetParam());
  const Sparse k = assemble_stiffness(mesh, nodes, {tissue, {20e3, 0.3}, {1e6, 0.49}});
  const double unit_strain =
      (k * flat(linear_field(nodes.positions, Mat3::Identity()))).lpNorm<Eigen::Infinity>();
  for (int a = 0; a < 3; ++a) {
    std::vector<Vec3> shift(nodes.size(), Vec3::Unit(a)), turn;
    for (const Vec3& p : nodes.positions) turn.push_back(Vec3::Unit(a).cross(p));
    EXPECT_LT((k * (0.1 * flat(shift))).lpNorm<Eigen::Infinity>(),
              1e-12 * unit_strain);  // about its own size
    EXPECT_LT((k * flat(turn)).lpNorm<Eigen::Infinity>(), 1e-12 * unit_strain);
  }
}

TEST_P(Orders, SymmetricToTheBitWithSixFreeMotionsAndPositiveDefiniteOnceAnchored) {
  const TetMesh mesh = GetParam() == 1 ? jittered_block({3, 2, 2}) : jittered_block({2, 2, 1});
  const ElementNodes nodes = element_nodes(mesh, GetParam());
  const Sparse k = assemble_stiffness(mesh, nodes, {tissue});
  ASSERT_TRUE(k.isCompressed());
  const Dense dense(k);
  EXPECT_TRUE(dense == dense.transpose());
  EXPECT_EQ(k.nonZeros(), Sparse(k.transpose()).nonZeros());  // both triangles stored
  const Vector spectrum = Eigen::SelfAdjointEigenSolver<Dense>(dense).eigenvalues();
  const double largest = spectrum[spectrum.size() - 1];
  EXPECT_LT(spectrum.head(6).cwiseAbs().maxCoeff(), 1e-13 * largest);
  EXPECT_GT(spectrum[6], 1e-4 * largest);

  const auto anchored =
      with_middles(anchored_nodes(mesh, {parse_anchor("half-space 0 0 0.03 0 0 1")}), nodes);
  const FreeStiffness free = remove_anchored(k, anchored);
  EXPECT_TRUE(free.matrix.isCompressed());
  const Vector held = Eigen::SelfAdjointEigenSolver<Dense>(Dense(free.matrix)).eigenvalues();
  EXPECT_GT(held[0], 1e-4 * largest);
}

// The energy of a quadratic field is that of its strain, integrated exactly over the block: u = (a x^2, b x
// y, c z^2) has divergence 2 a x + b x + 2 c z.
TEST(Stiffness, QuadraticTetrahedraKnowQuadraticFields) {
  const TetMesh mesh = jittered_block({3, 2, 2});
  const ElementNodes nodes = element_nodes(mesh, 2);
  const Vec3 lo(0.01, -0.02, 0.03), hi(0.07, 0.03, 0.07);
  const double a = 0.3, b = -0.2, c = 0.5;
  Vector u(static_cast<Eigen::Index>(3 * nodes.size()));
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Vec3& p = nodes.positions[i];
    u.segment<3>(static_cast<Eigen::Index>(3 * i)) << a * p.x() * p.x(), b * p.x() * p.y(), c * p.z() * p.z();
  }
  const Vec3 size = hi - lo;
  const auto mean = [&](int axis) { return 0.5 * (lo[axis] + hi[axis]); };
  const auto mean_square = [&](int axis) { return mean(axis) * mean(axis) + size[axis] * size[axis] / 12; };
  const double xx = mean_square(0), yy = mean_square(1), zz = mean_square(2), xz = mean(0) * mean(2);
  const double trace2 = (2 * a + b) * (2 * a + b) * xx + 4 * c * c * zz + 4 * (2 * a + b) * c * xz;
  const double norm2 = (4 * a * a + b * b) * xx + 4 * c * c * zz + 0.5 * b * b * yy;
  const double expected = size.prod() * (0.5 * tissue.lambda() * trace2 + tissue.mu() * norm2);
  EXPECT_NEAR(0.5 * u.dot(assemble_stiffness(mesh, nodes, {tissue}) * u), expected, 1e-11 * expected);
}

TEST(Stiffness, ElementsAreWhatIsAssembled) {
  TetMesh mesh;
  mesh.nodes = {Vec3(0.01, 0, 0), Vec3(0.05, 0.01, -0.01), Vec3(0, 0.04, 0.01), Vec3(0.02, 0.01, 0.06)};
  mesh.tets = {{0, 1, 2, 3}};
  mesh.regions = {0}, mesh.region_names = {"tissue"};
  const ElementNodes nodes = element_nodes(mesh, 2);
  const std::array<Vec3, 4> corners{mesh.nodes[0], mesh.nodes[1], mesh.nodes[2], mesh.nodes[3]};
  const Dense k(assemble_stiffness(mesh, nodes, {tissue})), one(element_stiffness_p2(corners, tissue));
  const auto of = nodes.of(0);
  for (std::size_t i = 0; i < 10; ++i)
    for (std::size_t j = 0; j < 10; ++j)
      EXPECT_TRUE((k.block<3, 3>(3 * of[i], 3 * of[j]) ==
                   one.block<3, 3>(static_cast<Eigen::Index>(3 * i), static_cast<Eigen::Index>(3 * j))));
}

TEST(ElementNodes, OfOrderTwoAreCornersAndMiddlesEachOnce) {
  const TetMesh mesh = jittered_block({3, 2, 2});
  const ElementNodes nodes = element_nodes(mesh, 2);
  EXPECT_EQ(nodes.size(), mesh.nodes.size() + nodes.edges.size());
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (std::size_t m = 0; m < 6; ++m) {
      const Index a = mesh.tets[e][tet_edges[m][0]], b = mesh.tets[e][tet_edges[m][1]];
      EXPECT_EQ(nodes.of(e)[4 + m], nodes.middle(b, a));
      EXPECT_LT((nodes.positions[static_cast<std::size_t>(nodes.of(e)[4 + m])] -
                 0.5 * (mesh.nodes[static_cast<std::size_t>(a)] + mesh.nodes[static_cast<std::size_t>(b)]))
                    .norm(),
                1e-15);
    }
  EXPECT_THROW(element_nodes(mesh, 3), Error);
  EXPECT_THROW(nodes.middle(0, 0), Error);
}

TEST(Stiffness, RemoveAnchoredKeepsTheOthers) {
  const TetMesh mesh = jittered_block({3, 2, 2});
  const Sparse k = assemble_stiffness(mesh, {tissue});
  std::vector<std::uint8_t> anchored(mesh.nodes.size(), 0);
  for (const std::size_t i : {0u, 5u, 6u, 17u, 35u}) anchored[i] = 1;
  const FreeStiffness free = remove_anchored(k, anchored);
  ASSERT_EQ(free.node_of.size() + 5, mesh.nodes.size());
  ASSERT_TRUE(std::is_sorted(free.node_of.begin(), free.node_of.end()));
  for (std::size_t i = 0; i < free.node_of.size(); ++i)
    EXPECT_EQ(free.free_of[static_cast<std::size_t>(free.node_of[i])], static_cast<Index>(i));
  const Dense all(k), rest(free.matrix);
  for (std::size_t i = 0; i < free.node_of.size(); ++i)
    for (std::size_t j = 0; j < free.node_of.size(); ++j) {
      EXPECT_EQ(free.free_of[static_cast<std::size_t>(free.node_of[i])], static_cast<Index>(i));
      EXPECT_TRUE(
          (rest.block<3, 3>(3 * i, 3 * j) == all.block<3, 3>(3 * free.node_of[i], 3 * free.node_of[j])));
    }
  EXPECT_EQ(std::count(free.free_of.begin(), free.free_of.end(), -1), 5);
}

// T eq. 5.3 and 5.4: rows and columns of the anchored nodes replaced by those of the identity.
TEST(Stiffness, DecoupledMatrixOfTheThesisHasTheSameInverse) {
  const TetMesh mesh = jittered_block({2, 2, 2});
  const Sparse k = assemble_stiffness(mesh, {tissue});
  const auto anchored = anchored_nodes(mesh, {parse_anchor("half-space 0 0 0.03 0 0 1")});
  Dense decoupled(k);
  for (Eigen::Index i = 0; i < decoupled.rows(); ++i)
    for (Eigen::Index j = 0; j < decoupled.cols(); ++j)
      if (anchored[static_cast<std::size_t>(i / 3)] || anchored[static_cast<std::size_t>(j / 3)])
        decoupled(i, j) = i == j ? 1 : 0;
  const Dense inverse = decoupled.partialPivLu().inverse();
  const FreeStiffness free = remove_anchored(k, anchored);
  const Dense compliance =
      Dense(free.matrix).llt().solve(Dense::Identity(free.matrix.rows(), free.matrix.cols()));
  double difference = 0;
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    for (std::size_t j = 0; j < mesh.nodes.size(); ++j) {
      const Index a = free.free_of[i], b = free.free_of[j];
      Mat3 expected = (i == j ? 1.0 : 0.0) * Mat3::Identity();
      if (a >= 0 && b >= 0) expected = compliance.block<3, 3>(3 * a, 3 * b);
      difference = std::max(difference, (inverse.block<3, 3>(3 * i, 3 * j) - expected).cwiseAbs().maxCoeff());
    }
  EXPECT_LT(difference, 1e-12 * compliance.cwiseAbs().maxCoeff());
}

TEST(Stiffness, EnergyOfUniaxialStrain) {
  const TetMesh mesh = jittered_block({4, 4, 4});
  const double e = 0.02, volume = 0.06 * 0.05 * 0.04;
  const Vector u = flat(linear_field(mesh.nodes, Vec3(0, 0, e).asDiagonal()));
  const double expected = 0.5 * volume * (tissue.lambda() + 2 * tissue.mu()) * e * e;
  EXPECT_NEAR(0.5 * u.dot(assemble_stiffness(mesh, {tissue}) * u), expected, 1e-12 * expected);
}

// A column of two materials that can only move along z is two springs in a row.
TEST(Stiffness, EachRegionHasItsMaterial) {
  TetMesh mesh = jittered_block({3, 3, 4});
  for (Vec3& p : mesh.nodes)
    p = make_block({Vec3(0.01, -0.02, 0.03), Vec3(0.07, 0.03, 0.07)}, {3, 3, 4})
            .nodes[static_cast<std::size_t>(&p - mesh.nodes.data())];
  mesh.region_names = {"lower", "unused", "upper"};
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    double z = 0;
    for (const Index v : mesh.tets[i]) z += 0.25 * mesh.nodes[static_cast<std::size_t>(v)].z();
    mesh.regions[i] = z < 0.04 ? 0 : 2;
  }
  const Material lower{3e3, 0.3}, upper{50e3, 0.48};
  const Sparse k = assemble_stiffness(mesh, {lower, tissue, upper});
  std::vector<bool> fixed(3 * mesh.nodes.size(), true);
  Vector u = Vector::Zero(static_cast<Eigen::Index>(fixed.size()));
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) {
    const double z = mesh.nodes[i].z();
    if (z > 0.0699) u[static_cast<Eigen::Index>(3 * i + 2)] = -0.001;
    fixed[3 * i + 2] = z > 0.0699 || z < 0.0301;
  }
  solve_statics(k, fixed, Vector::Zero(u.size()), u);
  double force = 0;
  const Vector f = k * u;
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    if (mesh.nodes[i].z() > 0.0699) force += f[static_cast<Eigen::Index>(3 * i + 2)];
  const double area = 0.06 * 0.05;
  const double expected =
      -0.001 * area / (0.01 / (lower.lambda() + 2 * lower.mu()) + 0.03 / (upper.lambda() + 2 * upper.mu()));
  EXPECT_NEAR(force, expected, 1e-12 * std::abs(expected));
}

TEST(Stiffness, TurnsWithTheBody) {
  TetMesh mesh = jittered_block({3, 2, 2});
  const Dense before(assemble_stiffness(mesh, {tissue}));
  const Mat3 r = Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized().toRotationMatrix();
  for (Vec3& p : mesh.nodes) p = r * p + Vec3(0.1, 0.2, -0.3);
  const Dense after(assemble_stiffness(mesh, {tissue}));
  for (Eigen::Index i = 0; i < before.rows(); i += 3)
    for (Eigen::Index j = 0; j < before.cols(); j += 3)
      EXPECT_LT(
          (after.block<3, 3>(i, j) - r * before.block<3, 3>(i, j) * r.transpose()).cwiseAbs().maxCoeff(),
          1e-12 * before.cwiseAbs().maxCoeff());
}

TEST(Stiffness, FollowsNodeNumbers) {
  const TetMesh mesh = jittered_block({3, 2, 2});
  std::vector<Index> to(mesh.nodes.size());
  std::iota(to.begin(), to.end(), 0);
  std::shuffle(to.begin(), to.end(), std::mt19937(5));
  TetMesh renumbered = mesh;
  for (std::size_t i = 0; i < to.size(); ++i)
    renumbered.nodes[static_cast<std::size_t>(to[i])] = mesh.nodes[i];
  for (Tetrahedron& t : renumbered.tets)
    for (Index& v : t) v = to[static_cast<std::size_t>(v)];
  const Dense a(assemble_stiffness(mesh, {tissue})), b(assemble_stiffness(renumbered, {tissue}));
  for (std::size_t i = 0; i < to.size(); ++i)
    for (std::size_t j = 0; j < to.size(); ++j)
      EXPECT_TRUE((a.block<3, 3>(3 * i, 3 * j) == b.block<3, 3>(3 * to[i], 3 * to[j])));
}

TEST_P(Orders, SameBitsForAnyNumberOfThreads) {
  const TetMesh mesh = GetParam() == 1 ? jittered_block({12, 11, 10}) : jittered_block({7, 6, 5});
  const ElementNodes nodes = element_nodes(mesh, GetParam());
  const Sparse one = assemble_stiffness(mesh, nodes, {tissue}, 1);
  for (const int threads : {2, 3, 7}) {
    const Sparse many = assemble_stiffness(mesh, nodes, {tissue}, threads);
    ASSERT_EQ(one.nonZeros(), many.nonZeros());
    EXPECT_TRUE(std::equal(one.valuePtr(), one.valuePtr() + one.nonZeros(), many.valuePtr()));
    EXPECT_TRUE(std::equal(one.innerIndexPtr(), one.innerIndexPtr() + one.nonZeros(), many.innerIndexPtr()));
    EXPECT_TRUE(std::equal(one.outerIndexPtr(), one.outerIndexPtr() + one.cols() + 1, many.outerIndexPtr()));
  }
}

TEST(Stiffness, StrainsOfALinearFieldAreItsSymmetricGradient) {
  const TetMesh mesh = jittered_block({3, 3, 3});
  const Mat3 expected = 0.5 * (some_gradient() + some_gradient().transpose());
  const auto all = strains(mesh, linear_field(mesh.nodes, some_gradient()));
  ASSERT_EQ(all.size(), mesh.tets.size());
  for (const Mat3& e : all) EXPECT_LT((e - expected).norm(), 1e-12 * expected.norm() + 1e-16);
}

TEST(Stiffness, BadInputIsNamed) {
  const auto kind_of = [](const TetMesh& mesh, const std::vector<Material>& materials) {
    try {
      assemble_stiffness(mesh, materials);
    } catch (const Error& e) {
      return e.kind();
    }
    return ErrorKind::internal;
  };
  const TetMesh good = jittered_block({2, 2, 2});
  EXPECT_EQ(kind_of(good, {}), ErrorKind::physics);
  EXPECT_EQ(kind_of(good, {tissue, tissue}), ErrorKind::physics);
  EXPECT_EQ(kind_of(good, {{10e3, 0.5}}), ErrorKind::physics);
  TetMesh bad = good;
  std::swap(bad.tets[7][0], bad.tets[7][1]);
  EXPECT_EQ(kind_of(bad, {tissue}), ErrorKind::geometry);
  bad = good;
  bad.tets[3][2] = 1000;
  EXPECT_EQ(kind_of(bad, {tissue}), ErrorKind::geometry);
  bad = good;
  bad.regions[3] = 1;
  EXPECT_EQ(kind_of(bad, {tissue}), ErrorKind::geometry);
  EXPECT_EQ(kind_of({}, {}), ErrorKind::geometry);
  EXPECT_THROW(strains(good, {}), Error);
}

}  // namespace
}  // namespace palpate::test
