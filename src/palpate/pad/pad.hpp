// From a closed surface to tetrahedra, in two ways. Stuffing: good angles, proven, at the size asked for, the
// surface met to a fraction of an element; Labelle, Shewchuk, "Isosurface stuffing" (2007). Delaunay, the
// thesis' method (T 5.1.2): the surface's own triangles, interior grid points, Delaunay tetrahedra by Qhull,
// those outside removed by winding number; Barber, Dobkin, Huhdanpaa, "The Quickhull algorithm for convex
// hulls" (1996).
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

enum class PadMethod : std::uint8_t { stuffing, delaunay };

struct PadOptions {
  PadMethod method = PadMethod::stuffing;
  // Stuffing: side of the finest lattice cells. Delaunay: spacing of the interior points near the surface; 0:
  // 1.4 times the surface's mean edge. m
  double spacing = 0;
  int surface_nodes = 3000;     // stuffing, where no spacing is given: reached within 10 %
  bool grade = true;            // coarser with depth
  std::string name = "tissue";  // region of what lies in no inner surface
  // Stuffing: accept open surfaces, whose holes the winding number bridges. Delaunay: smooth surfaces where
  // they run through themselves.
  bool repair = false;
};

// A place where the input surface is farther than half an element from the boundary.
struct MissedFeature {
  Vec3 at = Vec3::Zero();
  double distance = 0;  // m
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
  // Stuffing.
  std::size_t surface_nodes = 0, warped = 0, cut = 0, kept = 0;  // see Stuffed
  std::size_t islands = 0;                                       // parts too small for the elements, dropped
  double islands_volume = 0;                                     // m3
  double boundary_off = 0;            // farthest of the boundary's nodes and centres from the surface, m
  double missed_area = 0;             // of input triangles farther than half an element from the boundary, m2
  std::vector<MissedFeature> missed;  // the farthest first, at most ten, two elements apart and more
  TetQuality quality;
};

struct Padded {
  TetMesh mesh;
  PadReport report;
};

// `inner` surfaces (a stone in a kidney) lie inside, later ones win. By options.method.
Padded pad(const TriangleMesh& surface, const std::vector<NamedSurface>& inner = {},
           const PadOptions& options = {}, const Progress& progress = {});

// Throws Error(geometry): open surface, unless options.repair; nothing left at this size of elements.
Padded pad_stuffing(const TriangleMesh& surface, const std::vector<NamedSurface>& inner = {},
                    const PadOptions& options = {}, const Progress& progress = {});

// The boundary's vertices are the surface's vertices, in their order (node i = surface vertex i). Throws
// Error(geometry): open or self-overlapping surface (with the number of open edges), inner surface that
// leaves the outer one.
Padded pad_delaunay(const TriangleMesh& surface, const std::vector<NamedSurface>& inner = {},
                    const PadOptions& options = {}, const Progress& progress = {});

}  // namespace palpate
