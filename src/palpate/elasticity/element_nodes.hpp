// Nodes of linear (P1, CalculiX C3D4) and straight-sided quadratic (P2, C3D10) tetrahedra.
#pragma once

#include <span>
#include <vector>

#include "palpate/geometry/tet_mesh.hpp"

namespace palpate {

struct ElementNodes {
  int order = 1;                // 1: P1, 2: P2
  std::vector<Vec3> positions;  // at rest, m: the mesh's nodes, then for order 2 the middles of `edges`
  std::vector<std::array<Index, 2>>
      edges;                   // ends of each edge, the lower first, ascending; empty for order 1
  std::vector<Index> of_tets;  // per_tet() a tetrahedron: corners, middles of 01, 12, 02, 03, 13, 23 (as VTK)

  std::size_t size() const { return positions.size(); }
  std::size_t per_tet() const { return order == 1 ? 4 : 10; }
  std::span<const Index> of(std::size_t tet) const { return {of_tets.data() + per_tet() * tet, per_tet()}; }
  // Node in the middle of an edge of the mesh. Error(internal) where there is none.
  Index middle(Index a, Index b) const;
};

// The corners of the edge that each middle of a quadratic tetrahedron is on.
inline constexpr std::array<std::array<std::size_t, 2>, 6> tet_edges{
    {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

// Throws Error(usage) unless order is 1 or 2.
ElementNodes element_nodes(const TetMesh& mesh, int order);

// Flags of the mesh's nodes for all nodes: the middle of an edge has it where both ends have.
std::vector<std::uint8_t> with_middles(std::vector<std::uint8_t> flags, const ElementNodes& nodes);

}  // namespace palpate
