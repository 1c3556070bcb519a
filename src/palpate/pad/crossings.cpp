#include "palpate/pad/crossings.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace palpate {

namespace {

double orient(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return (b - a).cross(c - a).dot(d - a);
}

bool pierces(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
  const double size = std::max({(q - p).norm(), (b - a).norm(), (c - b).norm(), (a - c).norm()});
  const double touch = 1e-12 * size * size * size;
  const double x = orient(a, b, c, p), y = orient(a, b, c, q);
  if (!((x > touch && y < -touch) || (x < -touch && y > touch))) return false;
  const double u = orient(p, q, a, b), v = orient(p, q, b, c), w = orient(p, q, c, a);
  return (u > touch && v > touch && w > touch) || (u < -touch && v < -touch && w < -touch);
}

// Boxes of triangles in a balanced tree: node i of the range [begin, end) splits it in the middle.
class BoxTree {
 public:
  explicit BoxTree(std::vector<Box> boxes) : boxes_(std::move(boxes)), order_(boxes_.size()) {
    std::iota(order_.begin(), order_.end(), 0);
    nodes_.resize(2 * boxes_.size() + 1);
    build(0, 0, order_.size());
  }

  template <class Visit>
  void visit(const Box& box, const Visit& visit_one, std::size_t node = 0) const {
    const Node& n = nodes_[node];
    if (!n.box.intersects(box)) return;
    if (n.end - n.begin <= leaf) {
      for (std::size_t i = n.begin; i < n.end; ++i)
        if (boxes_[order_[i]].intersects(box)) visit_one(order_[i]);
      return;
    }
    visit(box, visit_one, node + 1);
    visit(box, visit_one, n.right);
  }

 private:
  static constexpr std::size_t leaf = 4;
  struct Node {
    Box box;
    std::size_t begin = 0, end = 0, right = 0;
  };

  std::size_t build(std::size_t node, std::size_t begin, std::size_t end) {  // returns the next free node
    Box box, centers;
    for (std::size_t i = begin; i < end; ++i)
      box.add(boxes_[order_[i]]), centers.add(boxes_[order_[i]].center());
    nodes_[node] = {box, begin, end, 0};
    if (end - begin <= leaf) return node + 1;
    Eigen::Index axis = 0;
    centers.size().maxCoeff(&axis);
    const std::size_t middle = (begin + end) / 2;
    const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end), [&](std::size_t x, std::size_t y) {
      return std::pair(boxes_[x].center()[axis], x) < std::pair(boxes_[y].center()[axis], y);
    });
    nodes_[node].right = build(node + 1, begin, middle);
    return build(nodes_[node].right, middle, end);
  }

  std::vector<Box> boxes_;
  std::vector<std::size_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace

std::vector<Crossing> crossings(std::span<const Vec3> vertices, std::span<const Triangle> triangles,
                                std::size_t limit) {
  const auto at = [&](Index v) -> const Vec3& { return vertices[static_cast<std::size_t>(v)]; };
  std::vector<Box> boxes(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (const Index v : triangles[t]) boxes[t].add(at(v));
  const BoxTree tree(boxes);
  std::vector<Crossing> result;
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index p = triangles[t][k], q = triangles[t][(k + 1) % 3];
      if (p > q) continue;  // the neighbour's turn
      Box box;
      box.add(at(p)), box.add(at(q));
      tree.visit(box, [&](std::size_t other) {
        const auto& [a, b, c] = triangles[other];
        if (a == p || b == p || c == p || a == q || b == q || c == q || result.size() >= limit) return;
        if (pierces(at(p), at(q), at(a), at(b), at(c)))
          result.push_back({static_cast<Index>(t), static_cast<Index>(other), (at(a) + at(b) + at(c)) / 3});
      });
    }
  return result;
}

}  // namespace palpate
