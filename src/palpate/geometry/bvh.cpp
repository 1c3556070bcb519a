// Tree: binned surface-area heuristic (Wald, "On fast construction of SAH-based bounding volume hierarchies",
// 2007). Search: wide_tree.hpp.
#include "palpate/geometry/bvh.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace palpate {

namespace {

// Closest point of the segment u v, lower (lexicographic) end first, so that the two triangles at an edge get
// the same bits.
struct OnSegment {
  Vec3 point;
  int where;  // 0: u, 1: v, 2: between
};
OnSegment closest_on_segment(const Vec3& p, const Vec3& u, const Vec3& v) {
  const bool swap = std::lexicographical_compare(v.data(), v.data() + 3, u.data(), u.data() + 3);
  const Vec3 &a = swap ? v : u, &b = swap ? u : v;
  const Vec3 ab = b - a;
  const double t = (p - a).dot(ab), length2 = ab.squaredNorm();
  if (!(t > 0)) return {a, swap ? 1 : 0};
  if (!(t < length2)) return {b, swap ? 0 : 1};
  return {a + (t / length2) * ab, 2};
}

}  // namespace

ClosestPoint closest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  ClosestPoint best;
  best.triangle = 0;
  const Vec3 ab = b - a, bc = c - b, ca = a - c, ap = p - a;
  const Vec3 n = ca.cross(ab);
  const double nn = n.squaredNorm();
  const double longest2 = std::max({ab.squaredNorm(), bc.squaredNorm(), ca.squaredNorm()});
  // Thinner than 1e-8 of its length, the normal is noise, and the edges are as near as the face.
  const bool flat = !(nn > 1e-16 * longest2 * longest2);
  // The nearest point lies on the face, or on an edge whose line parts p from the triangle. What is on an
  // edge but for rounding counts as on it, so that corners and edges get their own pseudonormals.
  const double on_edge = 1e-13 * nn;
  const std::array<bool, 3> beyond{flat || n.dot(ab.cross(ap)) <= on_edge,
                                   flat || n.dot(bc.cross(p - b)) <= on_edge,
                                   flat || n.dot(ca.cross(ap)) <= on_edge};
  if (!beyond[0] && !beyond[1] && !beyond[2]) {
    best.point = p - (n.dot(ap) / nn) * n;
    best.distance_squared = (p - best.point).squaredNorm();
    return best;
  }
  const std::array<const Vec3*, 3> corner{&a, &b, &c};
  for (std::size_t e = 0; e < 3; ++e) {
    if (!beyond[e]) continue;
    const std::size_t f = (e + 1) % 3;
    const OnSegment s = closest_on_segment(p, *corner[e], *corner[f]);
    const double d2 = (p - s.point).squaredNorm();
    if (d2 < best.distance_squared || best.feature == Feature::face) {
      best.point = s.point;
      best.distance_squared = d2;
      best.feature = s.where == 2 ? static_cast<Feature>(3 + e) : static_cast<Feature>(s.where == 0 ? e : f);
    }
  }
  return best;
}

namespace {

constexpr int bins = 16;
constexpr Index leaf_size = 8;
// From here on nodes are halved by count: at most 31 levels more, which the search's stack holds.
constexpr int deepest_by_area = 48;

float below(double x) {
  const auto f = static_cast<float>(x);
  return static_cast<double>(f) > x ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}
float above(double x) { return -below(-x); }

double half_area(const Box& box) {
  if (box.empty()) return 0;
  const Vec3 s = box.size();
  return s.x() * s.y() + s.y() * s.z() + s.z() * s.x();
}

// How many leaves n triangles fill: what they cost, as a leaf is searched at once.
double leaves(Index n) { return static_cast<double>((n + leaf_size - 1) / leaf_size); }

// Reorders [begin, end) and returns where the second part begins: the cheapest of 15 planes on each axis by
// the sum of leaves times area, or the middle where no plane parts them.
std::size_t split(const std::vector<Box>& boxes, std::vector<Index>& order, std::size_t begin,
                  std::size_t end, int depth) {
  Box centers;
  for (std::size_t i = begin; i < end; ++i) centers.add(boxes[static_cast<std::size_t>(order[i])].center());
  double best = std::numeric_limits<double>::infinity();
  int best_axis = -1, best_plane = 0;
  const auto bin_of = [&](Index t, int axis) {
    const double extent = centers.max[axis] - centers.min[axis];
    const double x = (boxes[static_cast<std::size_t>(t)].center()[axis] - centers.min[axis]) / extent;
    return std::clamp(static_cast<int>(bins * x), 0, bins - 1);
  };
  for (int axis = 0; axis < 3 && depth < deepest_by_area; ++axis) {
    if (!(centers.max[axis] > centers.min[axis])) continue;
    std::array<Box, bins> box;
    std::array<int, bins> count{};
    for (std::size_t i = begin; i < end; ++i) {
      const auto b = static_cast<std::size_t>(bin_of(order[i], axis));
      box[b].add(boxes[static_cast<std::size_t>(order[i])]);
      ++count[b];
    }
    std::array<double, bins> right{};
    Box sum;
    int n = 0;
    for (std::size_t b = bins - 1; b > 0; --b) {
      sum.add(box[b]);
      n += count[b];
      right[b] = n > 0 ? leaves(n) * half_area(sum) : -1;
    }
    sum = Box{};
    n = 0;
    for (std::size_t b = 0; b + 1 < bins; ++b) {
      sum.add(box[b]);
      n += count[b];
      if (n == 0 || right[b + 1] < 0) continue;
      const double cost = leaves(n) * half_area(sum) + right[b + 1];
      if (cost < best) best = cost, best_axis = axis, best_plane = static_cast<int>(b);
    }
  }
  const auto first = order.begin() + static_cast<std::ptrdiff_t>(begin);
  const auto last = order.begin() + static_cast<std::ptrdiff_t>(end);
  if (best_axis >= 0)
    return static_cast<std::size_t>(
        std::stable_partition(first, last, [&](Index t) { return bin_of(t, best_axis) <= best_plane; }) -
        order.begin());
  int axis = 0;
  if (!centers.empty()) centers.size().maxCoeff(&axis);
  std::stable_sort(first, last, [&](Index s, Index t) {
    return boxes[static_cast<std::size_t>(s)].center()[axis] <
           boxes[static_cast<std::size_t>(t)].center()[axis];
  });
  return begin + (end - begin) / 2;
}

}  // namespace

Bvh::Bvh(const TriangleMesh& mesh, Simd simd) {
  std::vector<Box> boxes(mesh.triangles.size());
  for (std::size_t i = 0; i < boxes.size(); ++i)
    for (const Index v : mesh.triangles[i]) boxes[i].add(mesh.vertices[static_cast<std::size_t>(v)]);
  if (boxes.empty()) return;

  struct Todo {
    std::size_t node, begin, end;
    int depth;
  };
  std::vector<Index> order(boxes.size());
  std::iota(order.begin(), order.end(), 0);
  nodes_.reserve(2 * boxes.size());
  nodes_.emplace_back();
  std::vector<WideTree::Range> ranges;  // as nodes_
  std::vector<Todo> todo{{0, 0, boxes.size(), 0}};
  while (!todo.empty()) {
    const Todo r = todo.back();
    todo.pop_back();
    Box box;
    for (std::size_t i = r.begin; i < r.end; ++i) box.add(boxes[static_cast<std::size_t>(order[i])]);
    Node node;
    for (int k = 0; k < 3; ++k) node.min[k] = below(box.min[k]), node.max[k] = above(box.max[k]);
    node.first = static_cast<Index>(r.begin);
    node.count = static_cast<Index>(r.end - r.begin);
    if (node.count > leaf_size) {
      const std::size_t middle = split(boxes, order, r.begin, r.end, r.depth);
      const std::size_t child = nodes_.size();
      node.first = static_cast<Index>(child);
      node.count = 0;
      nodes_.resize(child + 2);
      todo.push_back({child + 1, middle, r.end, r.depth + 1});
      todo.push_back({child, r.begin, middle, r.depth + 1});
    }
    nodes_[r.node] = node;
    ranges.resize(nodes_.size());
    ranges[r.node] = {static_cast<Index>(r.begin), static_cast<Index>(r.end),
                      node.count > 0 ? 0 : node.first};
  }

  corners_.reserve(order.size());
  slot_.resize(order.size());
  for (const Index i : order) {
    const Triangle& t = mesh.triangles[static_cast<std::size_t>(i)];
    slot_[static_cast<std::size_t>(i)] = static_cast<Index>(corners_.size());
    const Vec3 &a = mesh.vertices[static_cast<std::size_t>(t[0])],
               &b = mesh.vertices[static_cast<std::size_t>(t[1])],
               &c = mesh.vertices[static_cast<std::size_t>(t[2])];
    corners_.push_back({a, b, c, i});
  }
  std::vector<std::array<Vec3, 3>> corners;
  corners.reserve(corners_.size());
  for (const Corners& c : corners_) corners.push_back({c.a, c.b, c.c});
  tree_ = WideTree(ranges, corners, simd);
}

ClosestPoint Bvh::closest(const Vec3& p, double bound_squared, Index hint) const {
  struct Search {
    const Bvh& bvh;
    const Vec3& p;
    ClosestPoint best;
    static void take(void* context, const Index* slots, std::size_t n) {
      auto& [bvh, p, best] = *static_cast<Search*>(context);
      for (std::size_t i = 0; i < n; ++i) {
        const Corners& t = bvh.corners_[static_cast<std::size_t>(slots[i])];
        ClosestPoint q = closest_on_triangle(p, t.a, t.b, t.c);
        if (q.distance_squared < best.distance_squared ||
            (q.distance_squared == best.distance_squared && best.triangle > t.triangle)) {
          q.triangle = t.triangle;
          best = q;
        }
      }
    }
  } search{*this, p, {}};
  search.best.distance_squared = bound_squared;
  if (p.allFinite())
    tree_.search({p, std::sqrt(bound_squared), hint < 0 ? -1 : slot_[static_cast<std::size_t>(hint)],
                  Search::take, &search});
  return search.best;
}

}  // namespace palpate
