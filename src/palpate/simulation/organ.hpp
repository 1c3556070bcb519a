// A soft body, baked: tetrahedra, materials and anchors turned into the compliance between its surface nodes.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "palpate/base/progress.hpp"
#include "palpate/compliance/compliance.hpp"
#include "palpate/elasticity/anchor.hpp"
#include "palpate/elasticity/bedding.hpp"
#include "palpate/elasticity/hats.hpp"
#include "palpate/elasticity/material.hpp"
#include "palpate/geometry/tet_mesh.hpp"
#include "palpate/simulation/drawing.hpp"

namespace palpate {

class ContainerReader;

// How far off the elements are in a standard pinch (discretisation.hpp), against elements one order higher.
struct Discretisation {
  int against = 0;          // their order; 0: not known
  double stiffness = 0;     // by how much the organ is too stiff: of a force that presses it to a given depth
  double displacement = 0;  // largest difference of a surface node's, over the largest displacement
  Vec3 at = Vec3::Zero();   // of the first jaw, m
  double radius = 0;        // of the jaws' pressure, m: standard deviation of a bell
};

// Immutable after bake() or read_organ().
struct Organ {
  int order = 1;                    // of the tetrahedra: 1 linear, 2 quadratic (straight-sided)
  TetMesh mesh;                     // at rest, m
  std::vector<Material> materials;  // one a region, or one a tetrahedron (material_of)
  std::vector<Anchor> anchors;      // as given
  std::vector<Bedding> beddings;    // as given
  TriangleMesh surface;  // boundary of the mesh, at rest; its vertices are the surface nodes, numbered 0..s-1
  std::vector<Index> surface_nodes;  // mesh node of each surface node; size s
  // Where each surface node's displacement is read and its force acts, at rest, m: the node itself, or of
  // quadratic tetrahedra the centroid of its hat, over which the force is spread and the displacement a mean.
  std::vector<Vec3> contact_points;
  HatProjection projection;        // from those means to the surface nodes; of quadratic tetrahedra
  std::vector<double> areas;       // m2, a third of the adjacent triangles; size s
  std::vector<Index> row_of;       // row of each surface node in the compliance, -1: anchored; size s
  std::vector<Index> node_of_row;  // surface node of each row; size compliance.nodes()
  Compliance compliance;           // between the free contact points, m/N
  Discretisation discretisation;
  Drawing drawing;         // empty: the surface itself is drawn
  std::uint64_t hash = 0;  // of mesh, materials, anchors, beddings, order: what C was computed from

  std::size_t surface_size() const { return surface.vertices.size(); }
};

struct BakeReport {
  std::size_t nodes = 0, tets = 0, surface_nodes = 0, free_surface_nodes = 0, factor_entries = 0;
  double assemble_seconds = 0, order_seconds = 0, factor_seconds = 0, sweep_seconds = 0,
         pinch_seconds = 0;  // wall
};

// What tetrahedra, how the compliance is kept, and springs (docs/elasticity.md, docs/compliance.md).
struct BakeOptions {
  int order = 2;                                    // 1: linear, 2: quadratic tetrahedra
  std::optional<Storage> storage = Storage::dense;  // none: by size and memory
  double tolerance = 1e-3;                          // of the hierarchical storage
  std::size_t memory = 0;                           // bytes that baking may take; 0: what is free
  std::vector<Bedding> beddings = {};
  TriangleMesh drawing = {};  // a finer surface to draw; empty: none
  bool pinch = true;          // estimate the discretisation error
};

// Throws Error(geometry | physics | resource); memory is checked before the work starts.
Organ bake(TetMesh mesh, std::vector<Material> materials, std::vector<Anchor> anchors, int threads = 0,
           const Progress& progress = {}, BakeReport* report = nullptr, const BakeOptions& options = {});

// "1.0 % too stiff, displacement 3.1 % off ...", for people.
std::string to_string(const Discretisation& d);

std::uint64_t organ_hash(const Organ& organ);

// What follows from the rest of the organ: contact_points, projection and areas.
void set_readings(Organ& organ);

// HDF5, container kind "model". read_organ checks
// sizes, indices and the hash; verify: checksums of the big arrays too.
void write_organ(const std::filesystem::path& path, const Organ& organ, const std::string& provenance,
                 const Progress& progress = {});
Organ read_organ(const std::filesystem::path& path, bool verify = true, const Progress& progress = {});
// Of a model file alone.
Discretisation read_discretisation(const ContainerReader& in);

}  // namespace palpate
