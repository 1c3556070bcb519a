// Polygons of surface files to triangles.
#pragma once

#include <span>
#include <vector>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

class Triangulator {
 public:
  // Appends corners.size() - 2 triangles with the polygon's orientation: the fan of the first corner where
  // that is valid, by ear clipping where it is not (concave polygons, corners in a line). Corners are valid
  // vertices.
  void add(std::span<const Index> corners, std::span<const Vec3> vertices, std::vector<Triangle>& triangles);

 private:
  using Vec2 = Eigen::Vector2d;
  bool is_ear(std::size_t before, std::size_t tip, std::size_t after);

  std::size_t budget_ = 100'000'000;  // corner tests left: a damaged file must not cost hours
  std::vector<Vec2> flat_;            // corners in the polygon's plane
  std::vector<std::size_t> left_;     // corners not yet clipped, in order
};

}  // namespace palpate
