// From a closed surface to tetrahedra: the thesis' method (T 5.1.2). Interior grid points, Delaunay
// tetrahedra by Qhull, those outside removed by winding number. Barber, Dobkin, Huhdanpaa, "The Quickhull
// algorithm for convex hulls" (1996).
#pragma once

#include <string>
#include <vector>

#include "palpate/base/progress.hpp"
#include "palpate/geometry/tet_mesh.hpp"
#include "palpate/pad/unfold.hpp"

namespace palpate {

struct NamedSurface {
  std::string name;
  TriangleMesh surface;
};

struct PadOptions {
  double spacing = 0;  // of the interior points near the surface, m; 0: 1.4 times the surface's mean edge
  bool grade = true;   // coarser with depth (nested body-centred grids)
  std::string name = "tissue";  // region of what lies in no inner surface
  bool repair = false;          // smooth surfaces where they run through themselves, instead of an error
};

struct PadReport {
  std::size_t interior_points = 0;
  double spacing = 0;                 // of the interior points near the surface, m
  Unfolded repaired;                  // with options.repair, of all surfaces together
  bool flipped = false;               // the surface faced inwards and was turned round
  std::size_t removed_outside = 0;    // Delaunay tetrahedra outside the surface
  std::size_t recovered_edges = 0;    // surface edges that Delaunay missed and flips made
  std::size_t slivers_removed = 0;    // flat tetrahedra peeled off the boundary
  std::size_t missing_triangles = 0;  // input triangles (outer surface) that are no boundary face
  std::vector<Vec3> missing_at;       // centroids of the first ten
  std::size_t region_missing = 0;     // inner-surface triangles that are no interface face
  TetQuality quality;
};

struct Padded {
  TetMesh mesh;
  PadReport report;
};

// The boundary's vertices are the surface's vertices, in their order (node i = surface vertex i). `inner`
// surfaces (a stone in a kidney) lie inside, later ones inside earlier ones win. Throws Error(geometry): open
// or self-overlapping surface (with the number of open edges), inner surface that leaves the outer one.
Padded pad_delaunay(const TriangleMesh& surface, const std::vector<NamedSurface>& inner = {},
                    const PadOptions& options = {}, const Progress& progress = {});

}  // namespace palpate
