// Elastic bedding: organs hang in tissue, they are seldom nailed. Part of the surface is held by springs to
// ground, as Winkler's foundation: traction = -modulus * displacement, in all directions alike. Zienkiewicz,
// Taylor, The Finite Element Method vol. 1 (2000), ch. 2 (elastic support).
#pragma once

#include <Eigen/SparseCore>
#include <string>
#include <vector>

#include "palpate/elasticity/anchor.hpp"
#include "palpate/elasticity/element_nodes.hpp"

namespace palpate {

struct Bedding {
  double modulus = 0;  // N/m3: traction per displacement
  Anchor where;        // triangles of the boundary whose three corners it takes
};

// Reads "MODULUS where", as in "2e5 half-space 0 0 -0.016 0 0 1": N/m3 (Pa/m), then what parse_anchor reads.
// Error(usage) with the grammar otherwise.
Bedding parse_bedding(const std::string& text, double unit = 1.0);
std::string to_string(const Bedding& bedding);  // parse_bedding reads it back

// Adds the springs to the stiffness over `nodes`: the consistent matrix of each triangle, so that an even
// displacement gives an even traction. Several beddings add up. Throws Error(physics) where one takes no
// triangle, or its modulus is not positive.
void add_bedding(const TetMesh& mesh, const ElementNodes& nodes, const std::vector<Bedding>& beddings,
                 Eigen::SparseMatrix<double>& stiffness);

// A flag a node of the mesh: on a triangle of a bedding. The same errors.
std::vector<std::uint8_t> bedded_nodes(const TetMesh& mesh, const std::vector<Bedding>& beddings);

}  // namespace palpate
