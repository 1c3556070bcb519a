// Runs the program CalculiX (ccx) as a reference for elasticity and contact. Everything here returns nothing
// where ccx is not installed, and throws std::runtime_error with its log where it fails.
#pragma once

#include <optional>
#include <vector>

#include "palpate/elasticity/element_nodes.hpp"
#include "palpate/elasticity/material.hpp"
#include "palpate/geometry/tet_mesh.hpp"
#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate::test {

inline constexpr const char* no_calculix = "ccx is not installed (Debian: calculix-ccx)";

// Linear statics by the deck that write_calculix writes.
struct StaticReference {
  std::vector<Vec3> displacement;  // one a node, m, six decimals
  Vec3 reaction;                   // of the anchor, N
  double seconds;                  // wall, of the whole job
};
std::optional<StaticReference> calculix_static(const TetMesh& mesh, const ElementNodes& nodes,
                                               const std::vector<Material>& materials,
                                               const std::vector<std::uint8_t>& anchored,
                                               const std::vector<Vec3>& forces);

// Frictionless contact with a rigid closed surface that moves from where it is by `motion`: every node of the
// mesh's boundary that is not anchored against the tool's facets, small strain, contact found in the deformed
// state. `slope` is the penalty, N/m3: at 2e10 the bodies overlap by less than a micrometre.
struct ContactReference {
  std::vector<Vec3> displacement;  // of the mesh's nodes at the end, m
  Vec3 force;                      // of the mesh on the tool, N
  double seconds;                  // wall, of the whole job
};
// Large strains: Hooke's law between Green-Lagrange strain and second Piola-Kirchhoff stress, or a
// compressible neo-Hookean material of the same moduli.
enum class Elasticity { linear, saint_venant, neo_hooke };
std::optional<ContactReference> calculix_contact(const TetMesh& mesh, const std::vector<Material>& materials,
                                                 const std::vector<std::uint8_t>& anchored,
                                                 const TriangleMesh& tool, const Vec3& motion,
                                                 double slope = 2e10,
                                                 Elasticity elasticity = Elasticity::linear);

}  // namespace palpate::test
