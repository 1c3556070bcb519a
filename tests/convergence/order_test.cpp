// Manufactured solution: the error of linear tetrahedra falls with h^2 in displacement and with h in strain
// (the energy norm), of quadratic ones with h^3 and h^2. Brenner, Scott, The Mathematical Theory of Finite
// Element Methods (2008), ch. 5.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "support/meshes.hpp"
#include "support/statics.hpp"
#include "support/validation_table.hpp"

namespace palpate::test {
namespace {

// u = a sin(k.x + 1): its strain, and the body force that holds it.
struct Wave {
  Vec3 a = Vec3(0.001, -0.0007, 0.0012), k = Vec3(24, 33, -21);
  Vec3 u(const Vec3& x) const { return a * std::sin(k.dot(x) + 1); }
  Mat3 strain(const Vec3& x) const {
    return 0.5 * (a * k.transpose() + k * a.transpose()) * std::cos(k.dot(x) + 1);
  }
  Vec3 body_force(const Vec3& x, const Material& m) const {
    return ((m.lambda() + m.mu()) * a.dot(k) * k + m.mu() * k.squaredNorm() * a) * std::sin(k.dot(x) + 1);
  }
};

// A point of a tetrahedron: barycentric coordinates, and its share of the volume.
struct QuadraturePoint {
  std::array<double, 4> l;
  double weight;
};

// Gauss' points on a cube, folded onto the tetrahedron: exact for polynomials of degree seven.
std::vector<QuadraturePoint> quadrature() {
  const double inner = std::sqrt(3.0 / 7 - 2.0 / 7 * std::sqrt(1.2)),
               outer = std::sqrt(3.0 / 7 + 2.0 / 7 * std::sqrt(1.2));
  const std::array<double, 4> x{-outer, -inner, inner, outer};
  const double big = (18 + std::sqrt(30.0)) / 72, small = (18 - std::sqrt(30.0)) / 72;
  const std::array<double, 4> w{small, big, big, small};
  std::vector<QuadraturePoint> points;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < 4; ++j)
      for (std::size_t k = 0; k < 4; ++k) {
        const double a = 0.5 * (1 + x[i]), b = 0.5 * (1 + x[j]), c = 0.5 * (1 + x[k]);
        points.push_back({{(1 - a) * (1 - b) * (1 - c), a, (1 - a) * b, (1 - a) * (1 - b) * c},
                          6 * w[i] * w[j] * w[k] * (1 - a) * (1 - a) * (1 - b)});
      }
  return points;
}

// Shape functions and, with the gradients of the barycentric coordinates, theirs.
struct Shapes {
  std::vector<double> value;
  std::vector<Vec3> gradient;
  Shapes(int order, const std::array<double, 4>& l, const std::array<Vec3, 4>& g) {
    for (std::size_t i = 0; i < 4; ++i) {
      value.push_back(order == 1 ? l[i] : l[i] * (2 * l[i] - 1));
      gradient.push_back((order == 1 ? 1 : 4 * l[i] - 1) * g[i]);
    }
    if (order == 2)
      for (const auto& [a, b] : tet_edges) {
        value.push_back(4 * l[a] * l[b]);
        gradient.push_back(4 * (l[a] * g[b] + l[b] * g[a]));
      }
  }
};

struct Errors {
  double displacement, strain;  // L2, relative
};

// A block bent smoothly, no two tetrahedra alike: the shapes stay the same from grid to finer grid, which an
// order needs (random shapes get worse the more there are of them).
TetMesh bent_block(int cells) {
  TetMesh mesh = make_block({Vec3::Zero(), Vec3::Ones()}, {cells, cells, cells});
  for (Vec3& p : mesh.nodes)
    p = 0.06 * (p + 0.06 * Vec3(std::sin(3 * p.y() + p.z()), std::sin(3 * p.z() + p.x()),
                                std::sin(3 * p.x() + p.y())));
  return mesh;
}

Errors errors(int order, int cells, const Material& material) {
  const Wave wave;
  const TetMesh mesh = bent_block(cells);
  const ElementNodes nodes = element_nodes(mesh, order);
  // body(x, weight in m3, shape functions there, nodes of the tetrahedron)
  const auto integrate = [&](const auto& body) {
    static const std::vector<QuadraturePoint> points = quadrature();
    for (std::size_t e = 0; e < mesh.tets.size(); ++e) {
      Eigen::Matrix4d corners;
      for (int i = 0; i < 4; ++i)
        corners.col(i) << mesh.nodes[static_cast<std::size_t>(mesh.tets[e][static_cast<std::size_t>(i)])], 1;
      const Eigen::Matrix4d inverse = corners.inverse();
      std::array<Vec3, 4> g;
      for (std::size_t i = 0; i < 4; ++i) g[i] = inverse.row(static_cast<Eigen::Index>(i)).head<3>();
      for (const QuadraturePoint& q : points)
        body((corners * Eigen::Map<const Eigen::Vector4d>(q.l.data())).head<3>(),
             q.weight * six_volume(mesh, mesh.tets[e]) / 6, Shapes(order, q.l, g), nodes.of(e));
    }
  };
  std::vector<Vec3> force(nodes.size(), Vec3::Zero()), given(nodes.size(), Vec3::Zero());
  integrate([&](const Vec3& x, double weight, const Shapes& shape, std::span<const Index> of) {
    for (std::size_t i = 0; i < of.size(); ++i)
      force[static_cast<std::size_t>(of[i])] += weight * shape.value[i] * wave.body_force(x, material);
  });
  std::vector<std::uint8_t> on_boundary(nodes.size(), 0);
  const Boundary outer = boundary(mesh);
  const auto node = [&](Index vertex) { return outer.nodes[static_cast<std::size_t>(vertex)]; };
  for (const Triangle& t : outer.surface.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      on_boundary[static_cast<std::size_t>(node(t[i]))] = 1;
      if (order == 2)
        on_boundary[static_cast<std::size_t>(nodes.middle(node(t[i]), node(t[(i + 1) % 3])))] = 1;
    }
  std::vector<bool> fixed(3 * nodes.size(), false);
  for (std::size_t v = 0; v < nodes.size(); ++v) {
    if (!on_boundary[v]) continue;
    given[v] = wave.u(nodes.positions[v]);
    for (std::size_t a = 0; a < 3; ++a) fixed[3 * v + a] = true;
  }
  Vector u = flat(given);
  solve_statics(assemble_stiffness(mesh, nodes, {material}), fixed, flat(force), u);

  double du = 0, uu = 0, de = 0, ee = 0;
  integrate([&](const Vec3& x, double weight, const Shapes& shape, std::span<const Index> of) {
    Vec3 here = Vec3::Zero();
    Mat3 gradient = Mat3::Zero();
    for (std::size_t i = 0; i < of.size(); ++i) {
      const Vec3 at = u.segment<3>(3 * of[i]);
      here += shape.value[i] * at, gradient += at * shape.gradient[i].transpose();
    }
    const Mat3 strain = 0.5 * (gradient + gradient.transpose());
    du += weight * (here - wave.u(x)).squaredNorm(), uu += weight * wave.u(x).squaredNorm();
    de += weight * (strain - wave.strain(x)).squaredNorm(), ee += weight * wave.strain(x).squaredNorm();
  });
  return {std::sqrt(du / uu), std::sqrt(de / ee)};
}

TEST(Order, OfConvergenceIsThatOfTheory) {
  for (const int order : {1, 2})
    for (const double poisson : {0.3, 0.45, 0.49}) {
      Errors last{};
      for (const int cells : order == 1 ? std::array{3, 6, 12} : std::array{2, 4, 8}) {
        const Errors now = errors(order, cells, {10e3, poisson});
        const double in_displacement = std::log2(last.displacement / now.displacement),
                     in_strain = std::log2(last.strain / now.strain);
        std::printf(
            "P%d, nu %.2f, %2d cells a side: displacement %.3f %% (order %.2f), strain %.2f %% (%.2f)\n",
            order, poisson, cells, 100 * now.displacement, in_displacement, 100 * now.strain, in_strain);
        validation_row(
            "order", "order,poisson,cells,displacement_error,strain_error",
            fmt::format("{},{},{},{:.4g},{:.4g}", order, poisson, cells, now.displacement, now.strain));
        if (cells >= 8) {
          // Near 0.5 linear tetrahedra lock: 1.77 here, and still at 20 cells a side.
          EXPECT_NEAR(in_displacement, order + 1, poisson < 0.49 || order == 2 ? 0.15 : 0.25) << poisson;
          EXPECT_NEAR(in_strain, order, 0.15) << poisson;
        }
        last = now;
      }
    }
}

}  // namespace
}  // namespace palpate::test
