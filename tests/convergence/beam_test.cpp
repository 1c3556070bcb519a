// A cantilever of square section, five times as long as thick, against Timoshenko's beam: how much linear
// tetrahedra lock in bending, how that grows towards incompressibility, and that quadratic ones do not.
#include <gtest/gtest.h>

#include <utility>

#include "palpate/elasticity/anchor.hpp"
#include "support/meshes.hpp"
#include "support/statics.hpp"

namespace palpate::test {
namespace {

constexpr double thick = 0.02, length = 0.1, load = 0.01;  // m, m, N

// Timoshenko, Goodier; shear coefficient of Cowper 1966.
double timoshenko(const Material& m) {
  const double inertia = thick * thick * thick * thick / 12;
  const double shear = 10 * (1 + m.poisson) / (12 + 11 * m.poisson);
  return load * length * length * length / (3 * m.young * inertia) +
         load * length / (shear * m.mu() * thick * thick);
}

// Mean deflection of the free end under a shear traction over it.
double deflection(int order, int cells, const Material& material) {
  const TetMesh mesh = make_block({Vec3(0, 0, 0), Vec3(thick, thick, length)}, {cells, cells, 5 * cells});
  const ElementNodes nodes = element_nodes(mesh, order);
  const Boundary skin = boundary(mesh);
  const auto node = [&](Index vertex) { return skin.nodes[static_cast<std::size_t>(vertex)]; };
  std::vector<Vec3> force(nodes.size(), Vec3::Zero());
  for (const Triangle& t : skin.surface.triangles) {
    const double area = area_vector(skin.surface, t).z();
    if (area <= 0 || skin.surface.vertices[static_cast<std::size_t>(t[0])].z() < 0.999 * length) continue;
    // An even traction: a third on each corner, or on each middle of a quadratic triangle.
    for (std::size_t i = 0; i < 3; ++i)
      force[static_cast<std::size_t>(order == 1 ? node(t[i])
                                                : nodes.middle(node(t[i]), node(t[(i + 1) % 3])))]
          .x() += load * area / (3 * thick * thick);
  }
  const auto anchored = with_middles(anchored_nodes(mesh, {parse_anchor("half-space 0 0 0 0 0 1")}), nodes);
  const auto u = solve_statics(mesh, nodes, {material}, anchored, force);
  double work = 0;
  for (std::size_t i = 0; i < u.size(); ++i) work += force[i].dot(u[i]);
  return work / load;
}

TEST(Beam, ApproachesTimoshenkoFromTheStiffSide) {
  // Reached with the finest mesh: what is documented, so that a change for the worse is seen. Quadratic
  // tetrahedra with half the cells have as many unknowns. The clamped end holds the section, which a beam
  // leaves free to contract.
  struct Case {
    double poisson, linear, quadratic;
  };
  for (const Case& c : {Case{0.3, 0.92, 0.98}, {0.45, 0.81, 0.955}, {0.49, 0.56, 0.94}, {0.499, 0.17, 0.93}})
    for (const int order : {1, 2}) {
      const Material material{10e3, c.poisson};
      const double exact = timoshenko(material);
      double last = 0;
      std::printf("P%d, nu %.3f, deflection of Timoshenko's:", order, c.poisson);
      for (const int cells : order == 1 ? std::array{2, 4, 8} : std::array{1, 2, 4}) {
        const double ratio = deflection(order, cells, material) / exact;
        std::printf(" %.1f %% (%d cells)", 100 * ratio, cells);
        EXPECT_GT(ratio, last);
        EXPECT_LT(ratio, 1.0);
        last = ratio;
      }
      std::printf("\n");
      EXPECT_GT(last, order == 1 ? c.linear : c.quadratic);
    }
}

}  // namespace
}  // namespace palpate::test
