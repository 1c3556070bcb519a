// Systems to factorise: 3 unknowns a node, symmetric positive definite.
#pragma once

#include <Eigen/SparseCore>
#include <array>
#include <random>
#include <vector>

#include "palpate/base/vec.hpp"
#include "palpate/compliance/blas.hpp"

namespace palpate {

inline const bool blas_is_set_up = (set_up_blas(), true);

using Sparse = Eigen::SparseMatrix<double>;

// Couples the nodes of each edge by a random semi-definite 3 x 3 block, and ties every node down a little.
inline Sparse random_system(Index nodes, const std::vector<std::array<Index, 2>>& edges, unsigned seed,
                            double tie = 0.1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Eigen::Triplet<double>> entries;
  const auto add = [&](Index i, Index j, const Mat3& block, double sign) {
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) entries.emplace_back(3 * i + a, 3 * j + b, sign * block(a, b));
  };
  for (const auto& [i, j] : edges) {
    const Mat3 half = Mat3::NullaryExpr([&] { return uniform(random); });
    const Mat3 block = half * half.transpose() + 0.05 * Mat3::Identity();
    add(i, i, block, 1), add(j, j, block, 1), add(i, j, block, -1), add(j, i, block, -1);
  }
  for (Index i = 0; i < nodes; ++i) add(i, i, Mat3::Identity() * tie, 1);
  Sparse a(3 * nodes, 3 * nodes);
  a.setFromTriplets(entries.begin(), entries.end());
  return a;
}

inline std::vector<std::array<Index, 2>> grid_edges(int nx, int ny, int nz) {
  std::vector<std::array<Index, 2>> edges;
  const auto node = [&](int i, int j, int k) { return static_cast<Index>((i * ny + j) * nz + k); };
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j)
      for (int k = 0; k < nz; ++k) {
        if (i + 1 < nx) edges.push_back({node(i, j, k), node(i + 1, j, k)});
        if (j + 1 < ny) edges.push_back({node(i, j, k), node(i, j + 1, k)});
        if (k + 1 < nz) edges.push_back({node(i, j, k), node(i, j, k + 1)});
        if (i + 1 < nx && k + 1 < nz) edges.push_back({node(i, j, k), node(i + 1, j, k + 1)});
      }
  return edges;
}

inline std::vector<std::array<Index, 2>> random_edges(Index nodes, int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<Index> node(0, nodes - 1);
  std::vector<std::array<Index, 2>> edges;
  for (int e = 0; e < count; ++e)
    if (const Index i = node(random), j = node(random); i != j) edges.push_back({i, j});
  return edges;
}

// Largest |a - b| entry relative to sqrt(b_ii b_jj).
template <class A, class B>
double scaled_error(const A& a, const B& b) {
  const Eigen::VectorXd scale = b.diagonal().cwiseSqrt().cwiseInverse();
  return (scale.asDiagonal() * (a.template cast<double>() - b) * scale.asDiagonal()).cwiseAbs().maxCoeff();
}

}  // namespace palpate
