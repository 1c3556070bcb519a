// Input decks for CalculiX (ccx), so that anyone can check a model against it: palpate convert model.h5
// out.inp.
#pragma once

#include <filesystem>
#include <vector>

#include "palpate/elasticity/material.hpp"
#include "palpate/geometry/tet_mesh.hpp"

namespace palpate {

// C3D4, one *ELSET and *MATERIAL a region, anchored nodes fixed, nodal forces (N; may be empty) in one
// *STATIC step that prints U of all nodes and total RF. Numbers as %.12e: ccx reads at most 20 characters.
void write_calculix(const std::filesystem::path& path, const TetMesh& mesh,
                    const std::vector<Material>& materials, const std::vector<std::uint8_t>& anchored,
                    const std::vector<Vec3>& forces);

}  // namespace palpate
