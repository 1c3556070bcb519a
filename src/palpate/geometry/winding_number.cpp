#include "palpate/geometry/winding_number.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace palpate {

namespace {

constexpr std::size_t leaf_size = 8;

// Solid angle over 4 pi of a triangle seen from p, positive from behind (van Oosterom, Strackee).
double solid_angle(const Vec3& p, const std::array<Vec3, 3>& t) {
  const Vec3 a = t[0] - p, b = t[1] - p, c = t[2] - p;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  const double y = a.dot(b.cross(c));
  const double x = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
  // In the triangle's own plane (y = 0) there is no telling the sides: no angle.
  return y == 0 ? 0 : std::atan2(y, x) / (2 * std::numbers::pi);
}

std::array<Vec3, 3> corners(const TriangleMesh& mesh, const Triangle& t) {
  return {mesh.vertices[static_cast<std::size_t>(t[0])], mesh.vertices[static_cast<std::size_t>(t[1])],
          mesh.vertices[static_cast<std::size_t>(t[2])]};
}

Vec3 area_of(const std::array<Vec3, 3>& t) { return 0.5 * (t[1] - t[0]).cross(t[2] - t[0]); }
Vec3 centroid_of(const std::array<Vec3, 3>& t) { return (t[0] + t[1] + t[2]) / 3; }

}  // namespace

double winding_number(const TriangleMesh& mesh, const Vec3& p) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles) sum += solid_angle(p, corners(mesh, t));
  return sum;
}

WindingNumber::WindingNumber(const TriangleMesh& mesh, double accuracy) : accuracy_(accuracy) {
  corners_.reserve(mesh.triangles.size());
  for (const Triangle& t : mesh.triangles) corners_.push_back(corners(mesh, t));
  if (corners_.empty()) return;
  nodes_.emplace_back();
  nodes_[0].end = corners_.size();
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    expand(nodes_[n]);
    const std::size_t begin = nodes_[n].begin, end = nodes_[n].end;
    if (end - begin <= leaf_size) continue;
    Box centers;
    for (std::size_t i = begin; i < end; ++i) centers.add(centroid_of(corners_[i]));
    int axis = 0;
    centers.size().maxCoeff(&axis);
    const std::size_t middle = begin + (end - begin) / 2;
    const auto at = [&](std::size_t i) { return corners_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end), [axis](const auto& s, const auto& t) {
      return centroid_of(s)[axis] < centroid_of(t)[axis];
    });
    nodes_[n].child = nodes_.size();
    nodes_.resize(nodes_.size() + 2);
    nodes_[nodes_.size() - 2].begin = begin;
    nodes_[nodes_.size() - 2].end = nodes_[nodes_.size() - 1].begin = middle;
    nodes_[nodes_.size() - 1].end = end;
  }
}

void WindingNumber::expand(Node& node) const {
  double area = 0;
  for (std::size_t i = node.begin; i < node.end; ++i) {
    const double a = area_of(corners_[i]).norm();
    area += a;
    node.center += a * centroid_of(corners_[i]);
  }
  node.center = area > 0 ? Vec3(node.center / area) : corners_[node.begin][0];
  for (std::size_t i = node.begin; i < node.end; ++i) {
    const Vec3 n = area_of(corners_[i]);
    const Vec3 m = centroid_of(corners_[i]) - node.center;
    Mat3 yy = 9 * m * m.transpose();  // times 12: mean of y y^T over the triangle
    for (const Vec3& v : corners_[i]) {
      const Vec3 y = v - node.center;
      node.radius = std::max(node.radius, y.norm());
      yy += y * y.transpose();
    }
    yy /= 12;
    node.first += n;
    node.second += 0.5 * (m * n.transpose() + n * m.transpose());
    node.third += 2 * yy * n + yy.trace() * n;
    // (n.r) (r^T yy r) as x3 y3 z3, x2y x2z y2x y2z z2x z2y, xyz
    auto& c = node.cubic;
    for (int k = 0; k < 3; ++k) {
      const int u = (k + 1) % 3, v = (k + 2) % 3;
      c[static_cast<std::size_t>(k)] += n[k] * yy(k, k);
      c[static_cast<std::size_t>(3 + 2 * k)] += n[u] * yy(k, k) + 2 * n[k] * yy(k, u);
      c[static_cast<std::size_t>(4 + 2 * k)] += n[v] * yy(k, k) + 2 * n[k] * yy(k, v);
      c[9] += 2 * n[k] * yy(u, v);
    }
  }
}

// Sum over the triangles of int n.r/|r|^3 / (4 pi), r from the query to the surface, expanded about r =
// center - p to second order in y (Barill et al., section 3).
double WindingNumber::far_field(const Node& node, const Vec3& r) {
  const double rr = r.squaredNorm(), inv2 = 1 / rr, inv3 = inv2 / std::sqrt(rr);
  const double x = r.x(), y = r.y(), z = r.z();
  const auto& c = node.cubic;
  const double cubic = x * x * (c[0] * x + c[3] * y + c[4] * z) + y * y * (c[1] * y + c[5] * z + c[6] * x) +
                       z * z * (c[2] * z + c[7] * x + c[8] * y) + c[9] * x * y * z;
  const double sum = node.first.dot(r) + node.second.trace() - 3 * inv2 * r.dot(node.second * r) +
                     inv2 * (-1.5 * node.third.dot(r) + 7.5 * inv2 * cubic);
  return sum * inv3 / (4 * std::numbers::pi);
}

double WindingNumber::at(const Vec3& p) const {
  if (nodes_.empty()) return 0;
  double sum = 0;
  std::array<std::size_t, 96> stack;  // halving: at most 64 levels
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const Node& node = nodes_[stack[--top]];
    const Vec3 r = node.center - p;
    const double reach = accuracy_ * node.radius;
    if (r.squaredNorm() > reach * reach) {
      sum += far_field(node, r);
    } else if (node.child == 0) {
      for (std::size_t i = node.begin; i < node.end; ++i) sum += solid_angle(p, corners_[i]);
    } else {
      stack[top++] = node.child + 1;
      stack[top++] = node.child;
    }
  }
  return sum;
}

}  // namespace palpate
