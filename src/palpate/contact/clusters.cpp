#include "palpate/contact/clusters.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {

PlacedShape::PlacedShape(const Shape& s, const Pose& shape_to_organ) noexcept
    : shape(&s), to_organ(shape_to_organ), to_shape(shape_to_organ.inverse()) {
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
  Gap g = palpate::gap(*shape, to_shape * p);
  g.normal = to_organ.rotation * g.normal;
  return g;
}

Clusters::Clusters(std::span<const Vec3> points, std::vector<Index> given, std::size_t largest)
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
}

Box bound_clusters(const Clusters& clusters, std::span<const Vec3> positions,
                   std::span<ClusterBall> balls) noexcept {
  Box all;
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    const auto first = static_cast<std::size_t>(clusters.begin[c]),
               last = static_cast<std::size_t>(clusters.begin[c + 1]);
    Box box;
    for (std::size_t i = first; i < last; ++i)
      box.add(positions[static_cast<std::size_t>(clusters.nodes[i])]);
    const Vec3 center = box.center();
    double squared = 0;
    for (std::size_t i = first; i < last; ++i)
      squared =
          std::max(squared, (positions[static_cast<std::size_t>(clusters.nodes[i])] - center).squaredNorm());
    balls[c] = {center, std::sqrt(squared)};
    all.add(box);
  }
  return all;
}

}  // namespace palpate
