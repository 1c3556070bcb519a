// Manufactured solution: the error of linear tetrahedra falls with h^2 in displacement and with h in strain.
#include <gtest/gtest.h>

#include <cmath>

#include "support/meshes.hpp"
#include "support/statics.hpp"

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

// Four points of a tetrahedron, exact for quadratics: weight of the corner it is near, and of each other.
constexpr double near = 0.5854101966249685, far = 0.1381966011250105;

struct Errors {
  double displacement, strain;  // L2, relative
};

Errors errors(int cells, const Material& material) {
  const Wave wave;
  const TetMesh mesh = jittered_block({cells, cells, cells});
  const auto corner = [&](const Tetrahedron& t, std::size_t i) {
    return mesh.nodes[static_cast<std::size_t>(t[i])];
  };
  const auto point = [&](const Tetrahedron& t, std::size_t q) {
    return Vec3(far * (corner(t, 0) + corner(t, 1) + corner(t, 2) + corner(t, 3)) +
                (near - far) * corner(t, q));
  };
  std::vector<Vec3> force(mesh.nodes.size(), Vec3::Zero()), given(mesh.nodes.size(), Vec3::Zero());
  for (const Tetrahedron& t : mesh.tets)
    for (std::size_t q = 0; q < 4; ++q) {
      const Vec3 f = six_volume(mesh, t) / 24 * wave.body_force(point(t, q), material);
      for (std::size_t i = 0; i < 4; ++i) force[static_cast<std::size_t>(t[i])] += (i == q ? near : far) * f;
    }
  std::vector<bool> fixed(3 * mesh.nodes.size(), false);
  for (const Index v : boundary(mesh).nodes) {
    given[static_cast<std::size_t>(v)] = wave.u(mesh.nodes[static_cast<std::size_t>(v)]);
    for (int a = 0; a < 3; ++a) fixed[static_cast<std::size_t>(3 * v + a)] = true;
  }
  Vector u = flat(given);
  solve_statics(assemble_stiffness(mesh, {material}), fixed, flat(force), u);

  const std::vector<Vec3> nodal = unflat(u);
  const std::vector<Mat3> strain = strains(mesh, nodal);
  double du = 0, uu = 0, de = 0, ee = 0;
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (std::size_t q = 0; q < 4; ++q) {
      const Tetrahedron& t = mesh.tets[e];
      const Vec3 x = point(t, q);
      const double weight = six_volume(mesh, t) / 24;
      Vec3 here = Vec3::Zero();
      for (std::size_t i = 0; i < 4; ++i)
        here += (i == q ? near : far) * nodal[static_cast<std::size_t>(t[i])];
      du += weight * (here - wave.u(x)).squaredNorm(), uu += weight * wave.u(x).squaredNorm();
      de += weight * (strain[e] - wave.strain(x)).squaredNorm(), ee += weight * wave.strain(x).squaredNorm();
    }
  return {std::sqrt(du / uu), std::sqrt(de / ee)};
}

TEST(P1, ConvergesWithTheOrderOfTheory) {
  for (const double poisson : {0.3, 0.45, 0.49}) {
    Errors last{};
    for (const int cells : {3, 6, 12}) {
      const Errors now = errors(cells, {10e3, poisson});
      std::printf("nu %.2f, %2d cells a side: displacement %.2f %%, strain %.1f %%\n", poisson, cells,
                  100 * now.displacement, 100 * now.strain);
      if (cells == 12) {
        EXPECT_GT(std::log2(last.displacement / now.displacement), poisson < 0.49 ? 1.85 : 1.7) << poisson;
        EXPECT_GT(std::log2(last.strain / now.strain), 0.9) << poisson;
      }
      last = now;
    }
  }
}

}  // namespace
}  // namespace palpate::test
