// Stiffness of linear (P1, CalculiX C3D4) and straight-sided quadratic (P2, C3D10) tetrahedra.
// Zienkiewicz, Taylor, The Finite Element Method vol. 1 (2000), ch. 6; T 2.1 (with the sign note of
// Bro-Nielsen, Cotin 1996).
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "palpate/elasticity/element_nodes.hpp"
#include "palpate/elasticity/material.hpp"
#include "palpate/geometry/tet_mesh.hpp"

namespace palpate {

// Rows and columns: 3 a node, in the order of ElementNodes::of_tets. Quadrature of one point for P1 and of
// four for P2: exact, since the sides are straight. Throw Error(geometry) where flat or inverted.
Eigen::Matrix<double, 12, 12> element_stiffness_p1(const std::array<Vec3, 4>& corners,
                                                   const Material& material);
Eigen::Matrix<double, 30, 30> element_stiffness_p2(const std::array<Vec3, 4>& corners,
                                                   const Material& material);

// Of a tetrahedron: materials are one a region, or where their number differs from that, one a tetrahedron.
inline const Material& material_of(const TetMesh& mesh, const std::vector<Material>& materials,
                                   std::size_t tet) {
  return materials[materials.size() == mesh.region_names.size() ? static_cast<std::size_t>(mesh.regions[tet])
                                                                : tet];
}
// Error(physics) unless there is one a region or one a tetrahedron, and each is valid.
void require_valid(const TetMesh& mesh, const std::vector<Material>& materials);

// K over all nodes, 3 unknowns a node (x y z), N/m. Symmetric to the bit; both triangles are stored. Same
// bits for any thread count. materials: one a region or a tetrahedron. Throws Error(physics) or
// Error(geometry).
Eigen::SparseMatrix<double> assemble_stiffness(const TetMesh& mesh, const ElementNodes& nodes,
                                               const std::vector<Material>& materials, int threads = 0);
// The same over linear tetrahedra.
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

// Strain tensor of each linear tetrahedron for displacements of the mesh's nodes (m).
std::vector<Mat3> strains(const TetMesh& mesh, const std::vector<Vec3>& displacement);

}  // namespace palpate
