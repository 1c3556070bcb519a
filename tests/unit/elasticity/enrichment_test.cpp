#include "palpate/elasticity/enrichment.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <numeric>

#include "palpate/elasticity/stiffness.hpp"
#include "support/meshes.hpp"

namespace palpate {
namespace {

using Field = std::function<Vec3(const Vec3&)>;
using Vector = Eigen::VectorXd;

const Material material{10e3, 0.4, 1000};

// A block with displacements in the space of higher order: at the nodes, and the coefficients of what was
// added.
struct Enriched {
  TetMesh mesh;
  ElementNodes nodes;
  std::vector<Index> free_of;
  Enrichment more;
  Vector u, w;
};

std::vector<Index> all(std::size_t n) {
  std::vector<Index> out(n);
  std::iota(out.begin(), out.end(), 0);
  return out;
}

// A field is known by its values: the added functions' coefficients are fitted one by one, as many as they
// are, to its values at the middles of edges (linear tetrahedra), or at their thirds and the centres of
// faces.
Enriched enrich(int order, const std::array<int, 3>& cells, const Field& field) {
  TetMesh mesh = test::jittered_block(cells);
  ElementNodes nodes = element_nodes(mesh, order);
  const std::vector<Index> free_of = all(nodes.size());
  Enrichment more(mesh, nodes, {material}, free_of, all(mesh.tets.size()));
  Vector u(3 * static_cast<Eigen::Index>(nodes.size())), w(3 * static_cast<Eigen::Index>(more.size()));
  for (std::size_t i = 0; i < nodes.size(); ++i)
    u.segment<3>(3 * static_cast<Eigen::Index>(i)) = field(nodes.positions[i]);
  const auto x = [&](Index i) { return mesh.nodes[static_cast<std::size_t>(i)]; };
  for (std::size_t i = 0; i < more.size(); ++i) {
    const auto [a, b, c] = more.corners(i);
    Vec3 value;
    if (order == 1) {
      value = field(0.5 * (x(a) + x(b))) - 0.5 * (field(x(a)) + field(x(b)));
    } else if (c < 0) {
      // Interpolation at a third from a: 2/9 a, 8/9 middle, -1/9 b; the function is 2/27 there.
      const Vec3 p = (2 * x(a) + x(b)) / 3;
      value = 27.0 / 2 * (field(p) - (2 * field(x(a)) + 8 * field(0.5 * (x(a) + x(b))) - field(x(b))) / 9);
    } else {
      // Edge functions vanish at the centre of a face; the corners count -1/9, the middles 4/9.
      value =
          field((x(a) + x(b) + x(c)) / 3) + (field(x(a)) + field(x(b)) + field(x(c))) / 9 -
          4.0 / 9 * (field(0.5 * (x(a) + x(b))) + field(0.5 * (x(b) + x(c))) + field(0.5 * (x(c) + x(a))));
      value *= 27;
    }
    w.segment<3>(3 * static_cast<Eigen::Index>(i)) = value;
  }
  return {std::move(mesh), std::move(nodes), free_of, std::move(more), u, w};
}

// Twice the elastic energy.
double energy(const Enriched& e) {
  const Eigen::SparseMatrix<double> k = assemble_stiffness(e.mesh, e.nodes, {material});
  Vector force = k * e.u, added;
  e.more.multiply(e.u, e.w, force, added);
  return e.u.dot(force) + e.w.dot(added);
}

// Of a polynomial's gradient by the rule of Gauss on the whole box: exact to degree five along each axis.
double exact_energy(const std::function<Mat3(const Vec3&)>& gradient) {
  const Box box{Vec3(0.01, -0.02, 0.03), Vec3(0.07, 0.03, 0.07)};
  const std::array<double, 3> at{-std::sqrt(0.6), 0, std::sqrt(0.6)}, weight{5.0 / 18, 8.0 / 18, 5.0 / 18};
  double sum = 0;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec3 p = box.center() + 0.5 * box.size().cwiseProduct(Vec3(at[i], at[j], at[k]));
        const Mat3 h = gradient(p), strain = 0.5 * (h + h.transpose());
        sum += weight[i] * weight[j] * weight[k] *
               (2 * material.mu() * strain.squaredNorm() + material.lambda() * h.trace() * h.trace());
      }
  return sum * box.size().prod();
}

Vec3 cubic(const Vec3& p) {
  const double x = 20 * p.x(), y = 20 * p.y(), z = 20 * p.z();
  return {x * x * y - z * z * z + 0.3 * x * y, y * y * y + x * y * z - z * z,
          x * x * x - 2 * y * z * z + x * y};
}
Mat3 cubic_gradient(const Vec3& p) {
  const double x = 20 * p.x(), y = 20 * p.y(), z = 20 * p.z();
  Mat3 h;
  h << 2 * x * y + 0.3 * y, x * x + 0.3 * x, -3 * z * z, y * z, 3 * y * y + x * z, x * y - 2 * z,
      3 * x * x + y, -2 * z * z + x, -4 * y * z;
  return 20 * h;
}

TEST(Enrichment, LinearTetrahedraWithEdgesAreTheQuadraticOnes) {
  const Enriched e = enrich(1, {3, 3, 2}, cubic);
  const ElementNodes quadratic = element_nodes(e.mesh, 2);
  Vector u(3 * static_cast<Eigen::Index>(quadratic.size()));
  for (std::size_t i = 0; i < quadratic.size(); ++i)
    u.segment<3>(3 * static_cast<Eigen::Index>(i)) = cubic(quadratic.positions[i]);
  const double expected = u.dot(assemble_stiffness(e.mesh, quadratic, {material}) * u);
  EXPECT_NEAR(energy(e), expected, 1e-12 * expected);
}

TEST(Enrichment, QuadraticTetrahedraHoldACubicField) {
  const double expected = exact_energy(cubic_gradient);
  EXPECT_NEAR(energy(enrich(2, {3, 3, 2}, cubic)), expected, 1e-11 * expected);
}

TEST(Enrichment, IsSymmetric) {
  const Enriched e = enrich(2, {2, 2, 2}, cubic);
  const Vector u = Vector::Random(e.u.size()), w = Vector::Random(e.w.size());
  Vector force = Vector::Zero(u.size()), of_u, of_w, none = Vector::Zero(u.size());
  e.more.multiply(Vector::Zero(u.size()), w, force, of_w);  // K_uw w
  e.more.multiply(u, Vector::Zero(w.size()), none, of_u);   // K_wu u
  EXPECT_NEAR(u.dot(force), w.dot(of_u), 1e-10 * std::abs(u.dot(force)) + 1e-10 * u.norm());
  EXPECT_EQ(none.norm(), 0);
}

// A traction that is linear on the top, against a cubic field: the integral by Gauss over the top.
TEST(Enrichment, TractionsWorkOnAllFunctions) {
  const auto traction = [](const Vec3& p) { return Vec3(1 + 30 * p.x(), -2 + 10 * p.y(), 3 - 20 * p.x()); };
  const std::array<double, 3> at{-std::sqrt(0.6), 0, std::sqrt(0.6)}, weight{5.0 / 18, 8.0 / 18, 5.0 / 18};
  const Field quadratic = [](const Vec3& p) {
    return Vec3(p.x() * p.y(), p.y() * p.y(), p.x() * p.x() + p.y());
  };
  for (const int order : {1, 2}) {
    const Field field = order == 1 ? quadratic : Field(cubic);
    const Enriched e = enrich(order, {3, 2, 2}, field);
    double expected = 0;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) {
        const Vec3 p(0.04 + 0.03 * at[i], 0.005 + 0.025 * at[j], 0.07);
        expected += 0.06 * 0.05 * weight[i] * weight[j] * traction(p).dot(field(p));
      }
    Vector force = Vector::Zero(e.u.size()), added = Vector::Zero(e.w.size());
    const Boundary skin = boundary(e.mesh);
    for (const Triangle& t : skin.surface.triangles) {
      Triangle nodes;
      std::array<Vec3, 3> at_corners;
      bool top = true;
      for (std::size_t i = 0; i < 3; ++i) {
        const Vec3& p = skin.surface.vertices[static_cast<std::size_t>(t[i])];
        nodes[i] = skin.nodes[static_cast<std::size_t>(t[i])], at_corners[i] = traction(p);
        top = top && p.z() > 0.0699999;
      }
      if (top)
        e.more.add_traction(e.nodes, e.free_of, nodes, area_vector(skin.surface, t).norm(), at_corners, force,
                            added);
    }
    EXPECT_NEAR(e.u.dot(force) + e.w.dot(added), expected, 1e-12 * std::abs(expected)) << order;
  }
}

TEST(Enrichment, AddsNothingOutsideNorWhereAnchored) {
  const TetMesh mesh = test::jittered_block({3, 3, 3});
  const ElementNodes nodes = element_nodes(mesh, 2);
  const Enrichment one(mesh, nodes, {material}, all(nodes.size()), {5});
  EXPECT_LE(one.size(), 4u);  // all that is not on the boundary is a neighbour's, too
  const std::vector<Index> anchored(nodes.size(), -1);
  EXPECT_EQ(Enrichment(mesh, nodes, {material}, anchored, all(mesh.tets.size())).size(), 0u);
}

}  // namespace
}  // namespace palpate
