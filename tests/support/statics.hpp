// Linear statics of tetrahedra.
#pragma once

#include "palpate/compliance/blas.hpp"
#include "palpate/compliance/statics.hpp"
#include "palpate/elasticity/stiffness.hpp"

namespace palpate::test {

inline const bool blas_is_set_up_for_statics = (set_up_blas(), true);

using Vector = Eigen::VectorXd;
using palpate::solve_statics;

inline Vector flat(const std::vector<Vec3>& v) {
  return Eigen::Map<const Vector>(v.data()->data(), static_cast<Eigen::Index>(3 * v.size()));
}
inline std::vector<Vec3> unflat(const Vector& v) {
  std::vector<Vec3> out(static_cast<std::size_t>(v.size()) / 3);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = v.segment<3>(static_cast<Eigen::Index>(3 * i));
  return out;
}

// anchored and force: one a node of `nodes`.
inline std::vector<Vec3> solve_statics(const TetMesh& mesh, const ElementNodes& nodes,
                                       const std::vector<Material>& materials,
                                       const std::vector<std::uint8_t>& anchored,
                                       const std::vector<Vec3>& force) {
  std::vector<bool> fixed;
  for (const std::uint8_t a : anchored) fixed.insert(fixed.end(), 3, a != 0);
  Vector u = Vector::Zero(static_cast<Eigen::Index>(fixed.size()));
  solve_statics(assemble_stiffness(mesh, nodes, materials), fixed, flat(force), u);
  return unflat(u);
}
inline std::vector<Vec3> solve_statics(const TetMesh& mesh, const std::vector<Material>& materials,
                                       const std::vector<std::uint8_t>& anchored,
                                       const std::vector<Vec3>& force) {
  return solve_statics(mesh, element_nodes(mesh, 1), materials, anchored, force);
}

}  // namespace palpate::test
