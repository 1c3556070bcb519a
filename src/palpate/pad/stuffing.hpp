// From a closed surface to tetrahedra of proven quality: isosurface stuffing. The surface is met by warping
// the nodes of a graded body-centred lattice onto it and by cutting its tetrahedra where none is near.
// Labelle, Shewchuk, "Isosurface stuffing: fast tetrahedral meshes with good dihedral angles" (2007).
#pragma once

#include "palpate/geometry/signed_distance.hpp"
#include "palpate/pad/graded_lattice.hpp"
#include "palpate/pad/pad.hpp"

namespace palpate {

// The tetrahedra of one element size. Dihedral angles from 10.7 to 164.8 degrees, but at inner surfaces.
struct Stuffed {
  TetMesh mesh;                     // region 0 unless in an inner surface: 1 + its number
  std::size_t warped = 0, cut = 0;  // nodes moved onto the outer surface, nodes made on it
  std::size_t kept = 0;       // nodes near the surface left in place to keep the sampled solid's topology
  std::size_t islands = 0;    // parts of the sampled solid beyond `parts`: dropped
  double islands_volume = 0;  // m3
};

// cell: side of the finest cells, m. parts: of the solid, the largest of which are kept however small. Inner
// surfaces: later ones win. Throws Error(geometry) where the solid's sign changes far from its surface (a
// hole).
Stuffed stuff(const SignedDistanceField& outer, const std::vector<SignedDistanceField>& inner, const Box& box,
              double cell, std::size_t parts, bool grade, const Progress& progress = {});

}  // namespace palpate
