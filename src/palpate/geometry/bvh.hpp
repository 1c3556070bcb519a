// Closest point on a triangle mesh by a tree of boxes.
// Ericson, Real-Time Collision Detection (2005), 5.1.5 (closest point on a triangle) and ch. 6.
#pragma once

#include <limits>
#include <vector>

#include "palpate/geometry/triangle_mesh.hpp"
#include "palpate/geometry/wide_tree.hpp"

namespace palpate {

// The part of a triangle a closest point lies on.
enum class Feature : std::uint8_t { vertex0, vertex1, vertex2, edge01, edge12, edge20, face };

struct ClosestPoint {
  Vec3 point = Vec3::Zero();                                          // on the surface, m
  double distance_squared = std::numeric_limits<double>::infinity();  // m2
  Index triangle = -1;                                                // -1: none within the bound
  Feature feature = Feature::face;
};

// Exact to rounding for any triangle, needles and points included; never NaN for finite input. `triangle` is
// 0.
ClosestPoint closest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

// Built once, then const and thread-safe. Keeps its own copy of the corners.
class Bvh {
 public:
  // simd: for tests; the answer is the same to the bit.
  explicit Bvh(const TriangleMesh& mesh, Simd simd = best_simd());
  // The closest point nearer than sqrt(bound_squared). Of several at the same distance the lowest triangle
  // number wins, so the answer does not depend on the tree. `hint` is a triangle that is probably near (the
  // answer for a neighbouring point): it makes the search shorter and changes nothing else.
  ClosestPoint closest(const Vec3& p, double bound_squared = std::numeric_limits<double>::infinity(),
                       Index hint = -1) const;
  // Whether `test` holds for a triangle whose box (or its leaf's) meets `box`.
  template <class Test>
  bool any_in(const Box& box, const Test& test) const;

 private:
  struct Node {
    Vec3f min, max;  // rounded outwards
    Index first;     // leaf: slots [first, first + count); inner: children first and first + 1
    Index count;     // 0: inner
  };
  struct Corners {
    Vec3 a, b, c;
    Index triangle;
  };
  std::vector<Node> nodes_;
  std::vector<Corners> corners_;  // in tree order: slots
  std::vector<Index> slot_;       // of each triangle
  WideTree tree_;                 // what closest() searches
};

template <class Test>
bool Bvh::any_in(const Box& box, const Test& test) const {
  std::vector<Index> todo;
  if (!nodes_.empty()) todo.push_back(0);
  while (!todo.empty()) {
    const Node& node = nodes_[static_cast<std::size_t>(todo.back())];
    todo.pop_back();
    if (!box.intersects({node.min.cast<double>(), node.max.cast<double>()})) continue;
    if (node.count == 0) {
      todo.push_back(node.first + 1);
      todo.push_back(node.first);
    }
    for (Index i = node.first; i < node.first + node.count; ++i)
      if (test(corners_[static_cast<std::size_t>(i)].triangle)) return true;
  }
  return false;
}

}  // namespace palpate
