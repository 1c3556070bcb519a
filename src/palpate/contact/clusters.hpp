// Which surface nodes are near a rigid shape: the three stages of T 4.2. Boxes, then clusters of nodes
// against the shape's distance (a cluster whose centre is farther than its radius holds no near node: also
// the answer to the teapot in a stadium, T 7.2 point 2), then the nodes themselves.
#pragma once

#include <span>
#include <vector>

#include "palpate/contact/shape.hpp"

namespace palpate {

// A shape in the organ's frame.
struct PlacedShape {
  const Shape* shape = nullptr;
  Pose to_organ, to_shape;
  Box box;  // of the solid, organ frame; infinite for a half-space

  PlacedShape(const Shape& s, const Pose& shape_to_organ) noexcept;
  double distance(const Vec3& p) const noexcept { return palpate::distance(*shape, to_shape * p); }
  Gap gap(const Vec3& p) const noexcept;  // normal in the organ's frame
};

// Baked: nodes in groups of neighbours.
struct Clusters {
  std::vector<Index> nodes;  // all nodes given, grouped
  std::vector<Index> begin;  // first entry of each group in `nodes`; one more than there are groups

  Clusters() = default;
  // Splits `nodes` of `points` at the median of the longest axis until a group has at most `largest`.
  Clusters(std::span<const Vec3> points, std::vector<Index> nodes, std::size_t largest = 32);
  std::size_t size() const { return begin.empty() ? 0 : begin.size() - 1; }
};

// Bounds of the groups where the nodes are now.
struct ClusterBall {
  Vec3 center = Vec3::Zero();
  double radius = 0;
};
// balls.size() = clusters.size(). Returns the box of all nodes.
Box bound_clusters(const Clusters& clusters, std::span<const Vec3> positions,
                   std::span<ClusterBall> balls) noexcept;

// Calls found(node, distance) for every node of the clusters nearer to the shape than `reach` (m), in the
// order of the clusters.
template <class Found>
void near_nodes(const Clusters& clusters, std::span<const ClusterBall> balls, const Box& box,
                std::span<const Vec3> positions, const PlacedShape& shape, double reach,
                Found&& found) noexcept {
  const Box near = shape.box.grown(reach);
  if (!box.intersects(near)) return;
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    const ClusterBall& ball = balls[c];
    if (!near.grown(ball.radius).contains(ball.center) || shape.distance(ball.center) > ball.radius + reach)
      continue;
    for (auto i = static_cast<std::size_t>(clusters.begin[c]);
         i < static_cast<std::size_t>(clusters.begin[c + 1]); ++i) {
      const Vec3& p = positions[static_cast<std::size_t>(clusters.nodes[i])];
      if (!near.contains(p)) continue;
      const double d = shape.distance(p);
      if (d < reach) found(clusters.nodes[i], d);
    }
  }
}

}  // namespace palpate
