// Which nodes are fixed to the body's frame (T 4.3.2, 5.1.3), and the way to name parts of a body.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "palpate/geometry/tet_mesh.hpp"

namespace palpate {

struct AnchorBox {
  Box box;
};
struct AnchorSphere {
  Vec3 center;
  double radius;
};
struct AnchorHalfSpace {
  Vec3 point, normal;
};  // nodes with (x - point).normal <= 0
struct AnchorRegion {
  std::string name;
};  // all nodes of a region's tetrahedra
struct AnchorNodes {
  std::vector<Index> nodes;
};
using Anchor = std::variant<AnchorBox, AnchorSphere, AnchorHalfSpace, AnchorRegion, AnchorNodes>;

// Reads "box x0 y0 z0 x1 y1 z1", "sphere x y z r", "half-space px py pz nx ny nz", "region NAME", "nodes
// 1,2,3"; lengths (not normals) times `unit`, a box by any two opposite corners. Error(usage) with the
// grammar otherwise.
Anchor parse_anchor(const std::string& text, double unit = 1.0);
std::string to_string(const Anchor& anchor);  // metres; parse_anchor reads it back

// One flag a node: taken by one of them. Lengths have a tolerance of 1e-9 of the mesh's diagonal. Throws
// Error(usage) for a region or node that is not there.
std::vector<std::uint8_t> nodes_taken(const TetMesh& mesh, const std::vector<Anchor>& anchors);

// The same; nodes of no tetrahedron count as anchored, too: they have no stiffness. sprung: a flag a node
// that springs hold (bedding.hpp), or empty. Throws Error(physics) when anchored and sprung nodes leave a
// rigid motion free in some part (tetrahedra joined by faces): none at all, fewer than three, or all on one
// line; says which part and how to choose better.
std::vector<std::uint8_t> anchored_nodes(const TetMesh& mesh, const std::vector<Anchor>& anchors,
                                         const std::vector<std::uint8_t>& sprung = {});

}  // namespace palpate
