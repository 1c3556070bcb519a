// Volumes as tetrahedra, each in one region.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "palpate/base/vec.hpp"
#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

struct TetMesh {
  std::vector<Vec3> nodes;        // m
  std::vector<Tetrahedron> tets;  // positively oriented: (b-a)x(c-a).(d-a) > 0
  std::vector<Index> regions;     // region of each tetrahedron, an index into region_names; same size as tets
  std::vector<std::string> region_names;  // at least one when there are tetrahedra
};

// The boundary of a tetrahedral mesh: its outer surface, and which node each surface vertex is.
struct Boundary {
  TriangleMesh surface;
  std::vector<Index> nodes;  // node number of each surface vertex, ascending
};
Boundary boundary(const TetMesh& mesh);

// Six times the signed volume, m3.
double six_volume(const TetMesh& mesh, const Tetrahedron& t);

struct TetQuality {
  double volume = 0;                          // m3
  double min_dihedral = 0, max_dihedral = 0;  // degrees
  std::size_t inverted = 0;                   // tetrahedra with volume <= 0
  std::size_t slivers = 0;                    // smallest dihedral angle below 5 degrees
  std::vector<Index> inverted_at;             // the first ten of them
  Index worst = -1;                           // tetrahedron with the smallest dihedral angle
  std::array<std::size_t, 18> histogram{};    // all dihedral angles, bins of 10 degrees
  double min_volume = 0, max_volume = 0;      // m3, of a tetrahedron
  // Volumes over their mean, bins of a factor of two; the first: below 2^-10, the last: above 2^5.
  std::array<std::size_t, 17> volumes{};
};
TetQuality quality(const TetMesh& mesh);

// Throws Error(geometry) naming the first offender: index out of range, inverted or flat tetrahedron, NaN
// node. `what` names the mesh in the message (a file name).
void require_valid(const TetMesh& mesh, const std::string& what);

}  // namespace palpate
