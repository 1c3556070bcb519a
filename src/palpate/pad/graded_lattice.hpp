// The background of isosurface stuffing: a body-centred cubic lattice, fine at the surfaces and coarser with
// depth by an octree whose neighbouring leaves differ by at most one level, all in tetrahedra. Labelle,
// Shewchuk, "Isosurface stuffing: fast tetrahedral meshes with good dihedral angles" (2007, section 4).
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "palpate/base/progress.hpp"
#include "palpate/base/vec.hpp"

namespace palpate {

struct GradedLattice {
  Vec3 origin = Vec3::Zero();
  double cell = 0;                                 // side of the finest cells, m
  std::vector<std::array<std::int32_t, 3>> nodes;  // in units of cell / 2 from the origin
  std::vector<Tetrahedron> tets;                   // positively oriented
  std::vector<char> fine;                          // of each: between two cells of the finest level

  Vec3 position(Index node) const {
    const auto& n = nodes[static_cast<std::size_t>(node)];
    return origin + 0.5 * cell * Vec3(n[0], n[1], n[2]);
  }
};

// Lower bounds of what the lattice must know about a point: the signed distance to the outer surface, and the
// unsigned one to the nearest of all surfaces (m).
struct Depth {
  double outer = 0, nearest = 0;
};

// Covers all points with outer < cell, finest where nearest < 2 cell. `coarsest`: levels above the finest at
// most. Throws Error(resource) beyond `most_cells`.
GradedLattice grade_lattice(const Box& box, double cell, int coarsest, std::size_t most_cells,
                            const std::function<Depth(const Vec3&)>& depth, const Progress& progress = {});

}  // namespace palpate
