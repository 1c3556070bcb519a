// Which surface nodes are near a rigid shape: the three stages of T 4.2. Boxes, then clusters of nodes
// against the shape's distance (a cluster whose centre is farther than its radius holds no near node: also
// the answer to the teapot in a stadium, T 7.2 point 2), then the nodes themselves.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <vector>

#include "palpate/contact/shape.hpp"

namespace palpate {

// A shape in the organ's frame.
struct PlacedShape {
  const Shape* shape = nullptr;
  Pose to_organ, to_shape;
  Mat3 turn;          // of to_organ
  Box box;            // of the solid, organ frame; infinite for a half-space
  double finest = 0;  // palpate::finest(shape), m
  double band = 0;    // palpate::band(shape), m

  PlacedShape(const Shape& s, const Pose& shape_to_organ) noexcept;
  // In the shape's frame, and back.
  Vec3 own(const Vec3& p) const noexcept { return turn.transpose() * (p - to_organ.translation); }
  Vec3 in_organ(const Vec3& own) const noexcept { return turn * own + to_organ.translation; }
  double distance(const Vec3& p) const noexcept { return palpate::distance(*shape, own(p)); }
  // The same, but no more than the band: changes by no more than lipschitz times the way.
  double distance_in_band(const Vec3& p) const noexcept { return std::min(distance(p), band); }
  // Whether distance(p) may be below d.
  bool may_be_nearer(const Vec3& p, double d) const noexcept { return distance_bound(*shape, own(p)) < d; }
  Gap gap(const Vec3& p) const noexcept;  // normal in the organ's frame
};

// Baked: nodes in clusters of neighbours, clusters in groups of neighbours.
struct Clusters {
  static constexpr std::size_t per_group = 32;
  std::vector<Index> nodes;  // all nodes given, cluster by cluster
  std::vector<Index> begin;  // first entry of each cluster in `nodes`; one more than there are clusters
  // How far a node moves for a unit of drift (near_nodes), m / sqrt J: of each entry of `nodes`, and the most
  // in each cluster and each group.
  std::vector<float> softness, cluster_softness, group_softness;

  Clusters() = default;
  // Splits `nodes` of `points` at the median of the longest axis until a cluster has at most `largest`.
  // softness_of: a number a point; empty: 0.
  Clusters(std::span<const Vec3> points, std::vector<Index> nodes, std::size_t largest = 32,
           std::span<const float> softness_of = {});
  std::size_t size() const { return begin.empty() ? 0 : begin.size() - 1; }
  std::size_t groups() const { return (size() + per_group - 1) / per_group; }
};

struct Ball {
  Vec3 center = Vec3::Zero();
  double radius = 0;
};
// Where the nodes are: a ball about each cluster and each group, and the box of all.
struct ClusterBounds {
  std::vector<Ball> clusters, groups;
  Box box;

  ClusterBounds() = default;
  explicit ClusterBounds(const Clusters& of) : clusters(of.size()), groups(of.groups()) {}
  void update(const Clusters& of, std::span<const Vec3> positions) noexcept;
};

// Where nodes are about: at `positions` and from there `along` each of the changes, but for up to their
// softness times `drift`. What is not gone along need be no number.
struct Whereabouts {
  struct Shift {
    const ClusterBounds& bounds;
    std::span<const Vec3> moved;
    double along = 0;
  };
  const ClusterBounds& bounds;  // of the positions
  std::span<const Vec3> positions;
  std::array<Shift, 2> shifts;
  double drift = 0;

  Vec3 of(Index node) const noexcept {
    const auto k = static_cast<std::size_t>(node);
    Vec3 p = positions[k];
    for (const Shift& shift : shifts)
      if (shift.along != 0) p += shift.along * shift.moved[k];
    return p;
  }
  Ball of_cluster(std::size_t c) const noexcept {
    return moved(bounds.clusters[c], &ClusterBounds::clusters, c);
  }
  Ball of_group(std::size_t g) const noexcept { return moved(bounds.groups[g], &ClusterBounds::groups, g); }

 private:
  Ball moved(Ball ball, std::vector<Ball> ClusterBounds::*balls, std::size_t k) const noexcept {
    for (const Shift& shift : shifts) {
      if (shift.along == 0) continue;
      const Ball& change = (shift.bounds.*balls)[k];
      ball.center += shift.along * change.center, ball.radius += std::abs(shift.along) * change.radius;
    }
    return ball;
  }
};

// Calls look(node) for the nodes of the clusters that may hold one nearer to the shape than `reach` (m), but
// for those that are clearly not. In the order of the clusters.
template <class Look>
void look_near(const Clusters& clusters, const Whereabouts& where, const PlacedShape& shape, double reach,
               Look&& look) noexcept {
  // How far from the shape's surface the ball's centre is; infinite: no node in it is near.
  const auto away = [&](const Ball& ball, float softness) {
    const double grown = ball.radius + reach + where.drift * static_cast<double>(softness);
    if (!shape.box.grown(grown).contains(ball.center) || !shape.may_be_nearer(ball.center, grown))
      return std::numeric_limits<double>::infinity();
    const double d = shape.distance(ball.center);
    return d <= grown ? d : std::numeric_limits<double>::infinity();
  };
  for (std::size_t g = 0; g < clusters.groups(); ++g) {
    if (away(where.of_group(g), clusters.group_softness[g]) > 1e300) continue;
    const std::size_t last = std::min((g + 1) * Clusters::per_group, clusters.size());
    for (std::size_t c = g * Clusters::per_group; c < last; ++c) {
      const Ball ball = where.of_cluster(c);
      const double from_center = away(ball, clusters.cluster_softness[c]);
      if (from_center > 1e300) continue;
      for (auto i = static_cast<std::size_t>(clusters.begin[c]);
           i < static_cast<std::size_t>(clusters.begin[c + 1]); ++i) {
        const Vec3 p = where.of(clusters.nodes[i]);
        const double within = reach + where.drift * static_cast<double>(clusters.softness[i]);
        const double off = from_center - within;  // the ball's centre is so much too far, and p not nearer
        if (off > 0 && (p - ball.center).squaredNorm() < off * off) continue;
        look(clusters.nodes[i]);
      }
    }
  }
}

// Calls found(node, distance) for every node that is nearer than `reach`, in the order of the clusters.
template <class Found>
void near_nodes(const Clusters& clusters, const ClusterBounds& bounds, std::span<const Vec3> positions,
                const PlacedShape& shape, double reach, Found&& found) noexcept {
  const Whereabouts::Shift none{bounds, positions};
  look_near(clusters, {bounds, positions, {none, none}}, shape, reach, [&](Index node) {
    const Vec3& p = positions[static_cast<std::size_t>(node)];
    if (!shape.may_be_nearer(p, reach)) return;
    const double d = shape.distance(p);
    if (d < reach) found(node, d);
  });
}

}  // namespace palpate
