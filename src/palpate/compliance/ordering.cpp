#include "palpate/compliance/ordering.hpp"

#include <metis.h>

#include <algorithm>
#include <cstdlib>
#include <mutex>
#include <numeric>

#include "palpate/base/error.hpp"

namespace palpate {

static_assert(sizeof(idx_t) == sizeof(Index), "METIS of 32 bits is expected");

NodeGraph node_graph(const Eigen::SparseMatrix<double>& matrix) {
  if (matrix.rows() != matrix.cols() || matrix.rows() % 3 != 0)
    throw Error(ErrorKind::internal, "a stiffness of 3 unknowns a node is expected, got {} x {}",
                matrix.rows(), matrix.cols());
  const auto nodes = static_cast<std::size_t>(matrix.rows() / 3);
  NodeGraph graph;
  graph.begin.assign(nodes + 1, 0);
  graph.neighbours.reserve(static_cast<std::size_t>(matrix.nonZeros()) / 9 + 1);
  std::vector<Index> seen(nodes, -1);
  for (Index j = 0; j < static_cast<Index>(nodes); ++j) {
    seen[static_cast<std::size_t>(j)] = j;
    for (int a = 0; a < 3; ++a)
      for (Eigen::SparseMatrix<double>::InnerIterator it(matrix, 3 * j + a); it; ++it) {
        const auto i = static_cast<Index>(it.row() / 3);
        if (std::exchange(seen[static_cast<std::size_t>(i)], j) != j) graph.neighbours.push_back(i);
      }
    std::sort(graph.neighbours.begin() + graph.begin[static_cast<std::size_t>(j)], graph.neighbours.end());
    graph.begin[static_cast<std::size_t>(j) + 1] = static_cast<Index>(graph.neighbours.size());
  }
  return graph;
}

NodeGraph node_graph(const Eigen::SparseMatrix<double>& matrix, const Eigen::SparseMatrix<double>& loads) {
  const NodeGraph own = node_graph(matrix);
  const std::size_t nodes = own.nodes();
  std::vector<std::vector<Index>> touched(static_cast<std::size_t>(loads.cols()) / 3), loads_of(nodes);
  for (std::size_t j = 0; j < touched.size(); ++j) {
    for (Index a = 0; a < 3; ++a)
      for (Eigen::SparseMatrix<double>::InnerIterator it(loads, 3 * static_cast<Index>(j) + a); it; ++it)
        touched[j].push_back(static_cast<Index>(it.row() / 3));
    std::sort(touched[j].begin(), touched[j].end());
    touched[j].erase(std::unique(touched[j].begin(), touched[j].end()), touched[j].end());
    for (const Index node : touched[j])
      loads_of[static_cast<std::size_t>(node)].push_back(static_cast<Index>(j));
  }
  NodeGraph graph;
  graph.begin.push_back(0);
  graph.neighbours.reserve(own.neighbours.size());
  std::vector<Index> seen(nodes, -1);
  for (Index i = 0; i < static_cast<Index>(nodes); ++i) {
    seen[static_cast<std::size_t>(i)] = i;
    const auto add = [&](std::span<const Index> list) {
      for (const Index n : list)
        if (std::exchange(seen[static_cast<std::size_t>(n)], i) != i) graph.neighbours.push_back(n);
    };
    add(own.of(i));
    for (const Index j : loads_of[static_cast<std::size_t>(i)]) add(touched[static_cast<std::size_t>(j)]);
    std::sort(graph.neighbours.begin() + graph.begin.back(), graph.neighbours.end());
    graph.begin.push_back(static_cast<Index>(graph.neighbours.size()));
  }
  return graph;
}

std::vector<Index> nested_dissection(const Eigen::SparseMatrix<double>& matrix) {
  return nested_dissection(node_graph(matrix));
}

std::vector<Index> nested_dissection(NodeGraph graph) {
  std::vector<Index> order(graph.nodes()), inverse(graph.nodes());
  std::iota(order.begin(), order.end(), 0);
  // Nothing to gain on so few, and METIS is not at ease without edges.
  if (order.size() < 8 || graph.neighbours.empty()) return order;

  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = 1;
  options[METIS_OPTION_NUMBERING] = 0;
  auto nodes = static_cast<idx_t>(order.size());
  static std::mutex mutex;  // METIS seeds and draws from the process-wide rand()
  const std::lock_guard lock(mutex);
  if (METIS_NodeND(&nodes, graph.begin.data(), graph.neighbours.data(), nullptr, options, order.data(),
                   inverse.data()) != METIS_OK)
    throw Error(ErrorKind::resource, "METIS could not order {} nodes; it ran out of memory", nodes);
  return order;
}

}  // namespace palpate
