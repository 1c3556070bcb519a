// Tetrahedral meshes for tests: nothing in them is regular enough to hide a mistake.
#pragma once

#include <cmath>
#include <random>

#include "palpate/geometry/shapes.hpp"
#include "palpate/geometry/tet_mesh.hpp"

namespace palpate::test {

// Kuhn block of 6 x 5 x 4 cm with its interior nodes moved by up to a fifth of a cell.
inline TetMesh jittered_block(const std::array<int, 3>& cells, unsigned seed = 1) {
  const Box box{Vec3(0.01, -0.02, 0.03), Vec3(0.07, 0.03, 0.07)};
  TetMesh mesh = make_block(box, cells);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> move(-0.2, 0.2);
  const Vec3 h = box.size().cwiseQuotient(Vec3(cells[0], cells[1], cells[2]));
  for (Vec3& p : mesh.nodes) {
    const Vec3 by = h.cwiseProduct(Vec3(move(random), move(random), move(random)));
    if (((p - box.min).array() > 1e-9).all() && ((box.max - p).array() > 1e-9).all()) p += by;
  }
  return mesh;
}

// L-shaped bracket of 8 x 3 x 8 cm, tetrahedra graded towards the inner corner, three regions along z.
inline TetMesh graded_bracket(int cells) {
  const TetMesh block = make_block({Vec3(-1, 0, -1), Vec3(1, 1, 1)}, {cells, cells / 2, cells});
  TetMesh mesh;
  mesh.region_names = {"soft", "medium", "hard"};
  std::vector<Index> number(block.nodes.size(), -1);
  for (Tetrahedron t : block.tets) {
    Vec3 center = Vec3::Zero();
    for (const Index v : t) center += 0.25 * block.nodes[static_cast<std::size_t>(v)];
    if (center.x() > 0 && center.z() > 0) continue;
    for (Index& v : t) {
      Index& own = number[static_cast<std::size_t>(v)];
      if (own < 0) {
        own = static_cast<Index>(mesh.nodes.size());
        const Vec3 p = block.nodes[static_cast<std::size_t>(v)];
        const auto graded = [](double x) { return std::copysign(0.04 * std::pow(std::abs(x), 1.5), x); };
        mesh.nodes.push_back({graded(p.x()), 0.03 * p.y(), graded(p.z())});
      }
      v = own;
    }
    mesh.tets.push_back(t);
    mesh.regions.push_back(center.z() < -0.5 ? 0 : center.z() < 0 ? 1 : 2);
  }
  return mesh;
}

}  // namespace palpate::test
