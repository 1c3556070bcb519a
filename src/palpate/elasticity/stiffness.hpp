// Stiffness of linear (P1, CalculiX C3D4) tetrahedra.
// Zienkiewicz, Taylor, The Finite Element Method vol. 1 (2000), ch. 6; T 2.1 (with the sign note of
// Bro-Nielsen, Cotin 1996).
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "palpate/elasticity/material.hpp"
#include "palpate/geometry/tet_mesh.hpp"

namespace palpate {

using ElementStiffness = Eigen::Matrix<double, 12, 12>;
ElementStiffness element_stiffness_p1(const std::array<Vec3, 4>& corners, const Material& material);

// K over all nodes, 3 unknowns a node (x y z), N/m. Symmetric; both triangles are stored. Same bits for any
// thread count. materials: one a region. Throws Error(physics) or Error(geometry).
Eigen::SparseMatrix<double> assemble_stiffness(const TetMesh& mesh, const std::vector<Material>& materials,
                                               int threads = 0);

// K with the anchored nodes' rows and columns removed, and the map between the two numberings.
struct FreeStiffness {
  Eigen::SparseMatrix<double> matrix;  // 3 free nodes square, N/m
  std::vector<Index> node_of;          // mesh node of each free node, ascending
  std::vector<Index> free_of;          // free number of each mesh node, -1: anchored
};
FreeStiffness remove_anchored(const Eigen::SparseMatrix<double>& stiffness,
                              const std::vector<std::uint8_t>& anchored);

// Strain tensor of each tetrahedron for nodal displacements u (3 a node, m).
std::vector<Mat3> strains(const TetMesh& mesh, const std::vector<Vec3>& displacement);

}  // namespace palpate
