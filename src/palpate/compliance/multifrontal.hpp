// Sparse Cholesky factorisation by fronts, and in the same sweep the compliance between chosen nodes: C =
// (L^-1 P)^T (L^-1 P), with no backward solve, the right-hand sides pruned to the elimination tree. Duff,
// Reid, "The multifrontal solution of indefinite sparse symmetric linear equations" (1983); Liu, "The
// multifrontal method for sparse matrix solution: theory and practice" (1992). docs/compliance.md.
#pragma once

#include <Eigen/SparseCore>
#include <memory>
#include <span>
#include <vector>

#include "palpate/base/error.hpp"
#include "palpate/base/huge_array.hpp"
#include "palpate/base/progress.hpp"
#include "palpate/base/vec.hpp"

namespace palpate {

struct Symbolic;

struct SymbolicStats {
  std::size_t supernodes = 0;
  std::size_t factor_entries = 0;  // of L, dense supernodes
  double factor_flops = 0;
};

// A pivot that is not positive, or is noise beside the diagonal: the body can still move freely, or K is no
// stiffness. node: in the matrix's numbering.
class NotPositiveDefinite : public Error {
 public:
  explicit NotPositiveDefinite(Index node)
      : Error(ErrorKind::physics,
              "the stiffness is not positive definite at free node {}: anchor the part of the body that it "
              "is in, "
              "mend inverted or flat elements near it, or lower a Poisson's ratio that is too near 0.5",
              node),
        node_(node) {}
  Index node() const noexcept { return node_; }

 private:
  Index node_;
};

// P A P^T = L L^T, float64. Built once, then const and thread-safe.
class Cholesky {
 public:
  // matrix: symmetric positive definite, both triangles stored, 3 unknowns a node. order: elimination order
  // of the nodes, from nested_dissection. Throws NotPositiveDefinite.
  Cholesky(const Eigen::SparseMatrix<double>& matrix, const std::vector<Index>& order, int threads = 0,
           const Progress& progress = {});
  // With a structure that was found before (symbolic.hpp), as for other materials on the same mesh.
  Cholesky(const Eigen::SparseMatrix<double>& matrix, Symbolic symbolic, int threads = 0,
           const Progress& progress = {});
  ~Cholesky();
  Cholesky(Cholesky&&) noexcept;
  Cholesky& operator=(Cholesky&&) noexcept;

  const SymbolicStats& stats() const;
  // Solves A x = b in place; b has `columns` columns of 3n entries, column-major.
  void solve(std::span<double> b, std::size_t columns = 1) const;

  struct Impl;
  const Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

// (A^-1) between `nodes` (free numbering, distinct): full symmetric (3s)^2 row-major, row 3 i + a, column 3 j
// + b for nodes[i], nodes[j]. Float is the storage and the arithmetic of the sweep (3e-7 relative); double is
// for tests and certificates. Same bits for any number of threads.
template <class Scalar>
void compliance_sweep(const Cholesky& factor, std::span<const Index> nodes, std::span<Scalar> out,
                      int threads = 0, const Progress& progress = {});

// The same for force patterns: R^T A^-1 R, R 3n x 3s. The nodes that the columns 3 j, 3 j + 1, 3 j + 2 of R
// touch must each be coupled with the others in the factor's structure: node_graph(matrix, loads).
template <class Scalar>
void compliance_sweep(const Cholesky& factor, const Eigen::SparseMatrix<double>& loads, std::span<Scalar> out,
                      int threads = 0, const Progress& progress = {});

}  // namespace palpate
