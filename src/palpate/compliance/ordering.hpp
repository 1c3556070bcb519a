// Fill-reducing ordering by nested dissection. Karypis, Kumar, "A fast and high quality multilevel scheme for
// partitioning irregular graphs" (1998).
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "palpate/base/vec.hpp"

namespace palpate {

// Which nodes (3 unknowns each) a symmetric matrix couples: those of node i are neighbours[begin[i]] ..
// neighbours[begin[i + 1] - 1], ascending, without i itself. Explicit zeros count.
struct NodeGraph {
  std::vector<Index> begin, neighbours;

  std::size_t nodes() const { return begin.empty() ? 0 : begin.size() - 1; }
  std::span<const Index> of(Index node) const {
    const auto i = static_cast<std::size_t>(node);
    return {neighbours.data() + begin[i], static_cast<std::size_t>(begin[i + 1] - begin[i])};
  }
};
NodeGraph node_graph(const Eigen::SparseMatrix<double>& matrix);
// The same, and the nodes that the columns 3 j, 3 j + 1, 3 j + 2 of `loads` touch coupled with each other, as
// factor_compliance wants them.
NodeGraph node_graph(const Eigen::SparseMatrix<double>& matrix, const Eigen::SparseMatrix<double>& loads);

// Order of elimination of a graph's nodes: order[k] is eliminated k-th.
// Reproducible: METIS uses the global rand(), which is seeded under a mutex.
std::vector<Index> nested_dissection(NodeGraph graph);
std::vector<Index> nested_dissection(const Eigen::SparseMatrix<double>& matrix);

}  // namespace palpate
