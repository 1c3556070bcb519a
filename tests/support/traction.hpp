// Consistent nodal forces of tractions on the boundary.
#pragma once

#include <vector>

#include "palpate/elasticity/element_nodes.hpp"

namespace palpate::test {

// traction(x, unit normal outwards), Pa, over every triangle of the boundary. Quadrature of six points, exact
// for degree four: Dunavant, Int. J. Numer. Methods Eng. 21 (1985).
template <class Traction>
std::vector<Vec3> traction_forces(const TetMesh& mesh, const ElementNodes& nodes, const Traction& traction) {
  constexpr double a = 0.445948490915965, b = 0.091576213509771, wa = 0.223381589678011,
                   wb = 0.109951743655322;
  const Boundary skin = boundary(mesh);
  std::vector<Vec3> force(nodes.size(), Vec3::Zero());
  for (const Triangle& t : skin.surface.triangles) {
    const Vec3 area = area_vector(skin.surface, t);
    std::array<Index, 3> v{};
    for (std::size_t i = 0; i < 3; ++i) v[i] = skin.nodes[static_cast<std::size_t>(t[i])];
    for (std::size_t q = 0; q < 6; ++q) {
      const double l = q < 3 ? a : b;
      std::array<double, 3> at{l, l, l};
      at[q % 3] = 1 - 2 * l;
      Vec3 x = Vec3::Zero();
      for (std::size_t i = 0; i < 3; ++i) x += at[i] * mesh.nodes[static_cast<std::size_t>(v[i])];
      const Vec3 f = (q < 3 ? wa : wb) * area.norm() * traction(x, Vec3(area.normalized()));
      for (std::size_t i = 0; i < 3; ++i) {
        force[static_cast<std::size_t>(v[i])] += (nodes.order == 1 ? 1 : 2 * at[i] - 1) * at[i] * f;
        if (nodes.order == 2 && f != Vec3::Zero())
          force[static_cast<std::size_t>(nodes.middle(v[i], v[(i + 1) % 3]))] +=
              4 * at[i] * at[(i + 1) % 3] * f;
      }
    }
  }
  return force;
}

}  // namespace palpate::test
