// Ear clipping after Meisters, "Polygons have ears", 1975, in the plane of Newell's normal (Sutherland,
// Sproull and Schumacker, "A characterization of ten hidden-surface algorithms", 1974).
#include "palpate/io/polygon.hpp"

namespace palpate {

namespace {

double turn(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  const Eigen::Vector2d u = b - a, v = c - a;
  return u.x() * v.y() - u.y() * v.x();
}

Vec3 newell_normal(std::span<const Index> corners, std::span<const Vec3> vertices) {
  const Vec3& origin = vertices[static_cast<std::size_t>(corners[0])];
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < corners.size(); ++i)
    sum += (vertices[static_cast<std::size_t>(corners[i])] - origin)
               .cross(vertices[static_cast<std::size_t>(corners[i + 1])] - origin);
  return sum;
}

}  // namespace

bool Triangulator::is_ear(std::size_t before, std::size_t tip, std::size_t after) {
  const Vec2 &a = flat_[before], &b = flat_[tip], &c = flat_[after];
  if (!(turn(a, b, c) > 0)) return false;
  budget_ -= std::min(budget_, left_.size());
  for (const std::size_t i : left_) {
    const Vec2& p = flat_[i];
    if (p == a || p == b || p == c) continue;
    if (turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0) return false;
  }
  return true;
}

void Triangulator::add(std::span<const Index> corners, std::span<const Vec3> vertices,
                       std::vector<Triangle>& triangles) {
  const std::size_t n = corners.size();
  if (n == 3) return triangles.push_back({corners[0], corners[1], corners[2]});
  const Vec3 normal = newell_normal(corners, vertices);
  int axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  const int x = (axis + 1) % 3, y = (axis + 2) % 3;  // seen along the normal's largest part
  const double side = normal[axis] < 0 ? -1 : 1;
  flat_.clear(), left_.clear();
  bool fan = true;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& p = vertices[static_cast<std::size_t>(corners[i])];
    flat_.emplace_back(p[x], side * p[y]);
    left_.push_back(i);
    if (i >= 2) fan = fan && turn(flat_[0], flat_[i - 1], flat_[i]) > 0;
  }
  std::size_t tip = 1, misses = 0;
  while (!fan && left_.size() > 3 && misses < left_.size() && budget_ > 0) {
    const std::size_t m = left_.size(), before = (tip + m - 1) % m, after = (tip + 1) % m;
    if (is_ear(left_[before], left_[tip], left_[after])) {
      triangles.push_back({corners[left_[before]], corners[left_[tip]], corners[left_[after]]});
      left_.erase(left_.begin() + static_cast<std::ptrdiff_t>(tip));
      tip %= left_.size(), misses = 0;
    } else {
      tip = after, ++misses;
    }
  }
  // A fan, or what is left of a polygon that crosses itself.
  for (std::size_t i = 1; i + 1 < left_.size(); ++i)
    triangles.push_back({corners[left_[0]], corners[left_[i]], corners[left_[i + 1]]});
}

}  // namespace palpate
