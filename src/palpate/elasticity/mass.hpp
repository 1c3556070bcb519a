// Consistent mass of linear and straight-sided quadratic tetrahedra, for dynamics. Zienkiewicz, Taylor, The
// Finite Element Method vol. 1 (2000), ch. 17.2.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "palpate/elasticity/element_nodes.hpp"
#include "palpate/elasticity/material.hpp"

namespace palpate {

// M over all nodes, kg, one unknown a node: the same for x, y and z, that is, beside K it stands for M (x)
// I3. The integral of density u v for fields in the elements' space is exact: u.M v. Symmetric positive
// definite. materials: one a region or a tetrahedron. Throws Error(physics) or Error(geometry).
Eigen::SparseMatrix<double> assemble_mass(const TetMesh& mesh, const ElementNodes& nodes,
                                          const std::vector<Material>& materials);

}  // namespace palpate
