// What several benchmarks share: the demo's kidney with its stone, and the chess bishop of the thesis.
#pragma once

#include "palpate/pad/pad.hpp"
#include "palpate/simulation/model.hpp"

namespace palpate::scenes {

// The kidney with its stone, padded; materials one a region; its back anchored. At least so many vertices.
struct Kidney {
  TetMesh mesh;
  std::vector<Material> materials;
  std::vector<Anchor> anchors;
};
Kidney pad_kidney(int surface_nodes);
Organ bake_kidney(int surface_nodes, int order = 1, int threads = 0);

// bishop.iv of Debian's inventor-data, 13 cm tall along y, its middle at the origin.
TriangleMesh bishop();
// Its lattice with the fewest subdivisions that give at least so many grid points.
Grid bishop_grid(const TriangleMesh& bishop, std::size_t least_points);

// An instrument over the middle of the kidney's front.
struct Press {
  Model model;
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  Vec3 front = Vec3::Zero();  // of the kidney, in the middle, m
  double lowest = 0;          // z of the turned instrument, m
  // Its lowest point `depth` below the kidney's front, shifted along the kidney, m.
  Pose at(double depth, double along = 0) const { return {turn, front + Vec3(0, along, -depth - lowest)}; }
};
// The bishop's base, tilted by 11 degrees: first the rim, a sharp edge, then the disc of 59 mm.
Press press_bishop(Organ organ, std::size_t lattice_points, Mode mode);
// A ball of 30 mm radius as a lattice of 53^3 points.
Press press_ball(Organ organ);

}  // namespace palpate::scenes
