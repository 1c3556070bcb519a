#include "palpate/contact/clusters.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {

PlacedShape::PlacedShape(const Shape& s, const Pose& shape_to_organ) noexcept
    : shape(&s),
      to_organ(shape_to_organ),
      to_shape(shape_to_organ.inverse()),
      turn(shape_to_organ.rotation.toRotationMatrix()),
      finest(palpate::finest(s)),
      band(palpate::band(s)) {
  const Box own = bounding_box(s);
  if (!own.min.allFinite() || !own.max.allFinite()) {
    box = {Vec3::Constant(-std::numeric_limits<double>::infinity()),
           Vec3::Constant(std::numeric_limits<double>::infinity())};
    return;
  }
  for (int corner = 0; corner < 8; ++corner)
    box.add(to_organ * Vec3(corner & 1 ? own.max.x() : own.min.x(), corner & 2 ? own.max.y() : own.min.y(),
                            corner & 4 ? own.max.z() : own.min.z()));
}

Gap PlacedShape::gap(const Vec3& p) const noexcept {
  Gap g = palpate::gap(*shape, own(p));
  g.normal = turn * g.normal;
  return g;
}

Clusters::Clusters(std::span<const Vec3> points, std::vector<Index> given, std::size_t largest,
                   std::span<const float> softness_of)
    : nodes(std::move(given)) {
  struct Range {
    std::size_t first, last;
  };
  std::vector<Range> open;
  if (!nodes.empty()) open.push_back({0, nodes.size()});
  while (!open.empty()) {  // depth first, left part first: groups come out in order
    const Range r = open.back();
    open.pop_back();
    if (r.last - r.first <= std::max<std::size_t>(largest, 1)) {
      begin.push_back(static_cast<Index>(r.first));
      continue;
    }
    Box box;
    for (std::size_t i = r.first; i < r.last; ++i) box.add(points[static_cast<std::size_t>(nodes[i])]);
    int axis = 0;
    box.size().maxCoeff(&axis);
    const std::size_t middle = (r.first + r.last) / 2;
    const auto at = [&](std::size_t i) { return nodes.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(r.first), at(middle), at(r.last), [&](Index a, Index b) {
      const double x = points[static_cast<std::size_t>(a)][axis],
                   y = points[static_cast<std::size_t>(b)][axis];
      return x != y ? x < y : a < b;
    });
    open.push_back({middle, r.last});
    open.push_back({r.first, middle});
  }
  begin.push_back(static_cast<Index>(nodes.size()));
  if (nodes.empty()) begin.clear();
  softness.assign(nodes.size(), 0.0f);
  cluster_softness.assign(size(), 0.0f);
  group_softness.assign(groups(), 0.0f);
  for (std::size_t c = 0; c < size() && !softness_of.empty(); ++c)
    for (auto i = static_cast<std::size_t>(begin[c]); i < static_cast<std::size_t>(begin[c + 1]); ++i) {
      softness[i] = softness_of[static_cast<std::size_t>(nodes[i])];
      cluster_softness[c] = std::max(cluster_softness[c], softness[i]);
      group_softness[c / per_group] = std::max(group_softness[c / per_group], softness[i]);
    }
}

void ClusterBounds::update(const Clusters& of, std::span<const Vec3> positions) noexcept {
  box = {};
  Box group_box;
  for (std::size_t c = 0; c < of.size(); ++c) {
    const auto first = static_cast<std::size_t>(of.begin[c]),
               last = static_cast<std::size_t>(of.begin[c + 1]);
    Box own;
    for (std::size_t i = first; i < last; ++i) own.add(positions[static_cast<std::size_t>(of.nodes[i])]);
    const Vec3 center = own.center();
    double squared = 0;
    for (std::size_t i = first; i < last; ++i)
      squared = std::max(squared, (positions[static_cast<std::size_t>(of.nodes[i])] - center).squaredNorm());
    clusters[c] = {center, std::sqrt(squared)};
    box.add(own);
    group_box.add(own);
    if ((c + 1) % Clusters::per_group != 0 && c + 1 < of.size()) continue;
    const std::size_t g = c / Clusters::per_group;
    groups[g] = {group_box.center(), 0};
    for (std::size_t k = g * Clusters::per_group; k <= c; ++k)
      groups[g].radius =
          std::max(groups[g].radius, (clusters[k].center - groups[g].center).norm() + clusters[k].radius);
    group_box = {};
  }
}

}  // namespace palpate
