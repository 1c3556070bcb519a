// Input decks for CalculiX (ccx), so that anyone can check a model against it: palpate convert model.h5
// out.inp.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "palpate/elasticity/element_nodes.hpp"
#include "palpate/elasticity/material.hpp"
#include "palpate/geometry/tet_mesh.hpp"

namespace palpate {

// C3D4 or C3D10, one *ELSET and *MATERIAL a region (or of all tetrahedra with the same), anchored nodes fixed
// (a flag a node of `nodes`), nodal forces (N, one a node; may be empty) in one *STATIC step that prints U of
// all nodes and the total RF of the anchored ones. SI units; node i is number i + 1. Numbers as %.12e: ccx
// reads at most 20 characters. Throws Error(geometry | physics | file).
void write_calculix(const std::filesystem::path& path, const TetMesh& mesh, const ElementNodes& nodes,
                    const std::vector<Material>& materials, const std::vector<std::uint8_t>& anchored,
                    const std::vector<Vec3>& forces);

// The part of the deck before *STEP: node set NALL, ANCHOR (absent when no node is anchored); element sets
// REGION1, REGION2, ...
std::string calculix_model(const TetMesh& mesh, const ElementNodes& nodes,
                           const std::vector<Material>& materials, const std::vector<std::uint8_t>& anchored);

}  // namespace palpate
