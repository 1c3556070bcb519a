// The compliance in factored form: C = Y^T Y with Y = L^-1 P R, each column of Y being nonzero only on its
// path from a front of the elimination tree to the root. Exact, and ten times smaller than C.
#pragma once

#include <span>
#include <vector>

#include "palpate/base/huge_array.hpp"
#include "palpate/base/progress.hpp"
#include "palpate/compliance/multifrontal.hpp"
#include "palpate/compliance/symbolic.hpp"

namespace palpate {

// Terms that are summed up before they are added to a result: a sum of parts of a sum loses less to rounding.
// In float32, relative to sqrt(C_ii C_jj): 7e-7 at most, instead of 2.4e-6, for 3 % of the time.
constexpr std::size_t part_of_sum = 64;

// The columns are renumbered along the elimination ("rank"), so that those of a subtree are contiguous.
// Y is stored transposed: one row a column of Y, and along it the path from the root downwards.
template <class Scalar>
struct Factored {
  // A front with loads in its subtree.
  struct Branch {
    std::size_t begin = 0, own = 0, end = 0;  // ranks of its subtree; its own loads are the last
    std::size_t depth = 0, width = 0;  // its pivots' unknowns are depth .. depth + width - 1 of the path
    Index front = 0, parent = -1;      // parent: a branch
    std::size_t path() const { return depth + width; }
  };
  std::vector<Branch> branches;              // in postorder
  std::vector<Index> child_begin, children;  // of each branch, ascending
  std::vector<Index> load_at;                // load (the caller's number) of each triple of ranks
  // Y^T in panels of panel_rows rows (the last has fewer), each column-major and as long as its longest path.
  static constexpr std::size_t panel_rows = 1920;
  std::vector<std::size_t> panel_offset;
  HugeArray<Scalar> y;

  std::size_t size() const { return 3 * load_at.size(); }
  std::span<const Index> children_of(std::size_t b) const {
    return {children.data() + child_begin[b], static_cast<std::size_t>(child_begin[b + 1] - child_begin[b])};
  }
  // Where row `rank`, path position `k` is; its neighbours along the path are leading(rank) apart.
  std::size_t index(std::size_t rank, std::size_t k) const {
    return panel_offset[rank / panel_rows] + rank % panel_rows + k * leading(rank);
  }
  std::size_t leading(std::size_t rank) const {
    return std::min(panel_rows, size() - rank / panel_rows * panel_rows);
  }
  // Fills children and panel_offset from the branches. Returns the size of y.
  std::size_t arrange();
};

// Loads: column 3 j + a of `loads` is a force pattern over the matrix' unknowns. The nodes that the three
// columns of one j touch must lie on one path of the elimination tree: they do where each two of them are
// coupled.
template <class Scalar>
Factored<Scalar> factor_compliance(const Cholesky& cholesky, const Eigen::SparseMatrix<double>& loads,
                                   int threads, const Progress& progress);

// Y without its numbers, known before any work is done; y.size() would be arrange().
Factored<float> factored_outline(const Symbolic& symbolic, const Eigen::SparseMatrix<double>& loads);

// A unit force on each unknown of each node, of `all`.
Eigen::SparseMatrix<double> unit_loads(std::size_t all, std::span<const Index> nodes);

// C into `out`: full, symmetric, row-major, in the order of the loads.
template <class Scalar>
void multiply_out(const Factored<Scalar>& factored, std::span<Scalar> out, int threads,
                  const Progress& progress);

}  // namespace palpate
