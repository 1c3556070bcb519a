#include "palpate/geometry/wide_tree.hpp"

#include <algorithm>
#include <cmath>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace palpate {

namespace {

// Not below, not above x.
float above(double x) {
  const auto f = static_cast<float>(x);
  return static_cast<double>(f) < x ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

Mat3 rounded(const Mat3& m) { return m.cast<float>().cast<double>(); }

// Rows: the normal, the tangent along which the corners spread most, the other one.
Mat3 frame_of(const Vec3& normal, const Vec3* begin, const Vec3* end) {
  Mat3 frame;
  frame.row(0) = normal;
  const Vec3 u = normal.unitOrthogonal(), v = normal.cross(u);
  Vec3 mean = Vec3::Zero();
  for (const Vec3* c = begin; c != end; ++c) mean += *c;
  mean /= static_cast<double>(end - begin);
  double uu = 0, uv = 0, vv = 0;
  for (const Vec3* c = begin; c != end; ++c) {
    const double x = u.dot(*c - mean), y = v.dot(*c - mean);
    uu += x * x, uv += x * y, vv += y * y;
  }
  const double angle = 0.5 * std::atan2(2 * uv, uu - vv);
  frame.row(1) = std::cos(angle) * u + std::sin(angle) * v;
  frame.row(2) = std::cos(angle) * v - std::sin(angle) * u;
  return frame;
}

double half_area(const Vec3& s) { return s.x() * s.y() + s.y() * s.z() + s.z() * s.x(); }

}  // namespace

WideTree::WideTree(const std::vector<Range>& binary, const std::vector<std::array<Vec3, 3>>& corners,
                   Simd simd)
    : simd_(simd), corners_(corners) {
  if (binary.empty()) return;
  Box box;
  for (const auto& t : corners_)
    for (const Vec3& v : t) box.add(v);
  center_ = box.center();
  if (box.diagonal() > 0) scale_ = 0.5 * box.diagonal();
  for (auto& t : corners_)
    for (Vec3& v : t) v = (v - center_) / scale_;
  leaf_of_.resize(corners_.size());

  const auto count = [&](Index n) {
    return binary[static_cast<std::size_t>(n)].end - binary[static_cast<std::size_t>(n)].begin;
  };
  struct Todo {
    std::size_t node;
    Index root;  // of the binary tree
  };
  std::vector<Todo> todo{{0, 0}};
  nodes_.emplace_back();
  while (!todo.empty()) {
    const Todo now = todo.back();
    todo.pop_back();
    std::vector<Index> children{now.root};  // the biggest is opened until there are eight
    while (children.size() < 8) {
      const auto biggest = std::max_element(children.begin(), children.end(), [&](Index s, Index t) {
        const bool inner_s = binary[static_cast<std::size_t>(s)].child != 0,
                   inner_t = binary[static_cast<std::size_t>(t)].child != 0;
        return inner_s != inner_t ? inner_t : count(s) < count(t);
      });
      const Index child = binary[static_cast<std::size_t>(*biggest)].child;
      if (child == 0) break;
      *biggest = child;
      children.push_back(child + 1);
    }
    Boxes boxes{};
    for (std::size_t lane = 0; lane < children.size(); ++lane) {
      boxes.lanes |= 1u << lane;
      const Range& r = binary[static_cast<std::size_t>(children[lane])];
      fit(boxes, lane, r.begin, r.end);
      if (r.child == 0) {
        boxes.child[lane] = ~static_cast<Index>(leaves_.size());
        add_leaf(r.begin, r.end);
      } else {
        boxes.child[lane] = static_cast<Index>(nodes_.size());
        todo.push_back({nodes_.size(), children[lane]});
        nodes_.emplace_back();
      }
    }
    nodes_[now.node] = boxes;
  }
  corners_ = {};
}

// Along the axes, or turned by the triangles' mean normal where that is smaller.
void WideTree::fit(Boxes& boxes, std::size_t lane, Index begin, Index end) const {
  const Vec3* first = corners_[static_cast<std::size_t>(begin)].data();
  const Vec3* last = first + 3 * (end - begin);
  Vec3 normal = Vec3::Zero();
  for (const Vec3* c = first; c != last; c += 3) normal += (c[1] - c[0]).cross(c[2] - c[0]);
  std::array<Mat3, 2> frames{Mat3::Identity(), Mat3::Identity()};
  if (normal.norm() > 0 && normal.normalized().allFinite())
    frames[1] = rounded(frame_of(normal.normalized(), first, last));
  double best = std::numeric_limits<double>::infinity();
  for (const Mat3& frame : frames) {
    Box box;
    for (const Vec3* c = first; c != last; ++c) box.add(frame * *c);
    const Vec3f middle = box.center().cast<float>();
    const double area = half_area(box.size());
    if (!(area < best)) continue;
    best = area;
    for (int a = 0; a < 3; ++a) {
      const auto k = static_cast<std::size_t>(a);
      const auto m = static_cast<double>(middle[a]);
      for (int c = 0; c < 3; ++c)
        boxes.axis[k][static_cast<std::size_t>(c)][lane] = static_cast<float>(frame(a, c));
      boxes.middle[k][lane] = middle[a];
      boxes.half[k][lane] = above(std::max(box.max[a] - m, m - box.min[a]));
    }
  }
}

void WideTree::add_leaf(Index begin, Index end) {
  Triangles leaf{};
  leaf.first = begin;
  for (std::size_t lane = 0; lane < static_cast<std::size_t>(end - begin); ++lane) {
    const std::size_t slot = static_cast<std::size_t>(begin) + lane;
    leaf_of_[slot] = static_cast<Index>(leaves_.size());
    leaf.lanes |= 1u << lane;
    const std::array<Vec3, 3>& v = corners_[slot];
    const Vec3 ab = v[1] - v[0], bc = v[2] - v[1], ca = v[0] - v[2], n = ab.cross(bc);
    const double longest2 = std::max({ab.squaredNorm(), bc.squaredNorm(), ca.squaredNorm()});
    longest_ = std::max(longest_, std::sqrt(longest2));
    if (!(n.norm() > 1e-4 * longest2) || !(longest2 > 1e-20)) {
      leaf.thin |= 1u << lane;
      continue;
    }
    const Vec3 along = ab.normalized(), across = n.cross(ab).normalized();
    const auto put = [&](std::array<Lanes, 3>& to, const Vec3& x) {
      for (std::size_t c = 0; c < 3; ++c) to[c][lane] = static_cast<float>(x[static_cast<int>(c)]);
    };
    put(leaf.origin, v[0]);
    put(leaf.axis[0], along);
    put(leaf.axis[1], across);
    put(leaf.axis[2], n.normalized());
    leaf.x1[lane] = static_cast<float>(ab.norm());
    leaf.x2[lane] = static_cast<float>(-along.dot(ca));
    leaf.y2[lane] = static_cast<float>(-across.dot(ca));
    leaf.inverse12[lane] = static_cast<float>(1 / bc.squaredNorm());
    leaf.inverse20[lane] = static_cast<float>(1 / ca.squaredNorm());
  }
  leaves_.push_back(leaf);
}

}  // namespace palpate
