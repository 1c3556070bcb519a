// From a label volume to surfaces that can be padded.
#pragma once

#include <span>

#include "palpate/geometry/triangle_mesh.hpp"
#include "palpate/io/nifti.hpp"

namespace palpate {

// The closed surface around all voxels with one of these labels, m, facing outwards: where their indicator,
// smoothed by a Gaussian of 0.7 voxels against the steps between them, is one half, by marching tetrahedra
// (Doi, Koide, "An efficient method of triangulating equi-valued surfaces", 1991). Sheets of one voxel
// survive, wires of one voxel do not. Throws Error(geometry) when no voxel has such a label, or nothing is
// left.
TriangleMesh label_surface(const LabelVolume& volume, std::span<const std::int32_t> labels);

}  // namespace palpate
