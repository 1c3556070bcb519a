// Linear shape functions of a tetrahedron. Zienkiewicz, Taylor, The Finite Element Method vol. 1 (2000),
// ch. 6.
#pragma once

#include "palpate/base/error.hpp"
#include "palpate/geometry/tet_mesh.hpp"

namespace palpate {

// Their constant gradients, and the volume.
struct Gradients {
  std::array<Vec3, 4> g;  // 1/m
  double volume;          // m3
};

// Throws Error(geometry) where flat or inverted.
inline Gradients gradients(const std::array<Vec3, 4>& x) {
  const Vec3 a = x[1] - x[0], b = x[2] - x[0], c = x[3] - x[0];
  const Vec3 bc = b.cross(c), ca = c.cross(a), ab = a.cross(b);
  const double six = a.dot(bc);
  if (!(six > 0))
    throw Error(ErrorKind::geometry, "a tetrahedron is flat or inverted (volume {} m3)", six / 6);
  Gradients r{{Vec3::Zero(), bc / six, ca / six, ab / six}, six / 6};
  r.g[0] = -(r.g[1] + r.g[2] + r.g[3]);
  return r;
}

inline std::array<Vec3, 4> corners_of(const TetMesh& mesh, const Tetrahedron& t) {
  std::array<Vec3, 4> x;
  for (std::size_t i = 0; i < 4; ++i) x[i] = mesh.nodes[static_cast<std::size_t>(t[i])];
  return x;
}

}  // namespace palpate
