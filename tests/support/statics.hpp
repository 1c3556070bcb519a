// Linear statics by Eigen's sparse factorisation: independent of the compliance stage.
#pragma once

#include <Eigen/SparseCholesky>
#include <stdexcept>

#include "palpate/elasticity/stiffness.hpp"

namespace palpate::test {

using Vector = Eigen::VectorXd;

inline Vector flat(const std::vector<Vec3>& v) {
  return Eigen::Map<const Vector>(v.data()->data(), static_cast<Eigen::Index>(3 * v.size()));
}
inline std::vector<Vec3> unflat(const Vector& v) {
  std::vector<Vec3> out(static_cast<std::size_t>(v.size()) / 3);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = v.segment<3>(static_cast<Eigen::Index>(3 * i));
  return out;
}

// K u = f where free; where fixed[i] (one a unknown), u is given. The given entries of u stay.
inline void solve_statics(const Eigen::SparseMatrix<double>& stiffness, const std::vector<bool>& fixed,
                          const Vector& force, Vector& u) {
  std::vector<int> number(fixed.size(), -1);
  int n = 0;
  for (std::size_t i = 0; i < fixed.size(); ++i)
    if (!fixed[i]) number[i] = n++, u[static_cast<Eigen::Index>(i)] = 0;
  const Vector residual = force - stiffness * u;
  Vector right(n);
  std::vector<Eigen::Triplet<double>> entries;
  for (int c = 0; c < stiffness.outerSize(); ++c)
    for (Eigen::SparseMatrix<double>::InnerIterator it(stiffness, c); it; ++it) {
      const int row = number[static_cast<std::size_t>(it.row())],
                column = number[static_cast<std::size_t>(c)];
      if (row >= 0 && column >= 0) entries.emplace_back(row, column, it.value());
    }
  for (std::size_t i = 0; i < fixed.size(); ++i)
    if (!fixed[i]) right[number[i]] = residual[static_cast<Eigen::Index>(i)];
  Eigen::SparseMatrix<double> matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(matrix);
  if (factor.info() != Eigen::Success) throw std::runtime_error("factorisation failed");
  const Vector x = factor.solve(right);
  for (std::size_t i = 0; i < fixed.size(); ++i)
    if (!fixed[i]) u[static_cast<Eigen::Index>(i)] = x[number[i]];
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
