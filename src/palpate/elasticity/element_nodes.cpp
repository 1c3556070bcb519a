#include "palpate/elasticity/element_nodes.hpp"

#include <algorithm>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {

std::array<Index, 2> sorted(Index a, Index b) { return {std::min(a, b), std::max(a, b)}; }

}  // namespace

Index ElementNodes::middle(Index a, Index b) const {
  const std::array<Index, 2> edge = sorted(a, b);
  const auto at = std::lower_bound(edges.begin(), edges.end(), edge);
  if (at == edges.end() || *at != edge)
    throw Error(ErrorKind::internal, "nodes {} and {} are not joined by an edge", a, b);
  return static_cast<Index>(positions.size() - edges.size()) + static_cast<Index>(at - edges.begin());
}

ElementNodes element_nodes(const TetMesh& mesh, int order) {
  if (order != 1 && order != 2)
    throw Error(ErrorKind::usage, "elements of order {}: say 1 (linear) or 2 (quadratic)", order);
  ElementNodes nodes;
  require_valid(mesh, "mesh");
  nodes.order = order;
  nodes.positions = mesh.nodes;
  nodes.of_tets.reserve(nodes.per_tet() * mesh.tets.size());
  if (order == 2) {
    for (const Tetrahedron& t : mesh.tets)
      for (const auto& [a, b] : tet_edges) nodes.edges.push_back(sorted(t[a], t[b]));
    std::sort(nodes.edges.begin(), nodes.edges.end());
    nodes.edges.erase(std::unique(nodes.edges.begin(), nodes.edges.end()), nodes.edges.end());
    for (const auto& [a, b] : nodes.edges)
      nodes.positions.push_back(
          0.5 * (mesh.nodes[static_cast<std::size_t>(a)] + mesh.nodes[static_cast<std::size_t>(b)]));
  }
  for (const Tetrahedron& t : mesh.tets) {
    nodes.of_tets.insert(nodes.of_tets.end(), t.begin(), t.end());
    if (order == 2)
      for (const auto& [a, b] : tet_edges) nodes.of_tets.push_back(nodes.middle(t[a], t[b]));
  }
  return nodes;
}

std::vector<std::uint8_t> with_middles(std::vector<std::uint8_t> flags, const ElementNodes& nodes) {
  for (const auto& [a, b] : nodes.edges)
    flags.push_back(flags[static_cast<std::size_t>(a)] && flags[static_cast<std::size_t>(b)]);
  return flags;
}

}  // namespace palpate
