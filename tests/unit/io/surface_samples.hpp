// Small surface files, written here byte by byte, and what they hold.
#pragma once

#include <string>
#include <vector>

namespace palpate {

struct SurfaceSample {
  std::string name, bytes;
  std::size_t vertices, triangles;
  double volume;  // file units cubed; all are closed and face outwards
};

// Every format and dialect that is read. Unless they say otherwise: the tetrahedron of the origin and the
// three unit vectors, or the unit cube.
std::vector<SurfaceSample> surface_samples();
// Those that are read in this process, without palpate-import.
std::vector<SurfaceSample> own_surface_samples();

// A .glb of a tetrahedron with this JSON for its nodes, and indices for 3 or 4 vertices of the kind it names.
std::string glb(const std::string& nodes, int mode = 4,
                const std::vector<int>& indices = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2});

// A NIfTI-1 volume of 2 x 3 x 4 voxels whose labels are their numbers, in mm.
std::string nifti1(bool swapped = false, int datatype = 2);

}  // namespace palpate
