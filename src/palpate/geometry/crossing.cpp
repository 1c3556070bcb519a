// Moeller, Trumbore, "Fast, minimum storage ray/triangle intersection" (1997); coplanar pairs by clipping.
#include "palpate/geometry/crossing.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

// Relative: what is so near counts as touching. In a sound mesh nothing touches without sharing a corner, and
// in symmetric ones that cross themselves edge often meets edge.
constexpr double touch = 1e-9;

// Whether the segment from p along d meets the triangle, both in one plane with normal n.
bool meets_in_plane(const Vec3& p, const Vec3& d, const std::array<Vec3, 3>& t, const Vec3& n) {
  double from = 0, to = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3& a = t[i];
    const Vec3 inwards = n.cross(t[(i + 1) % 3] - a);
    const double height = inwards.dot(t[(i + 2) % 3] - a);  // of the third corner
    const double at = inwards.dot(p - a) + touch * height, slope = inwards.dot(d);
    if (std::abs(slope) <= touch * height) {
      if (at < 0) return false;
    } else if (slope > 0) {
      from = std::max(from, -at / slope);
    } else {
      to = std::min(to, -at / slope);
    }
  }
  return to >= from;
}

bool meets(const Vec3& p, const Vec3& q, const std::array<Vec3, 3>& t) {
  const Vec3 n = (t[1] - t[0]).cross(t[2] - t[0]), d = q - p;
  const double area = n.norm();
  if (!(area > 0)) return false;
  const double above_p = n.dot(p - t[0]) / area, above_q = n.dot(q - t[0]) / area;
  const double thin = touch * (d.norm() + std::sqrt(area));
  if (std::min(above_p, above_q) > thin || std::max(above_p, above_q) < -thin) return false;
  if (std::max(std::abs(above_p), std::abs(above_q)) <= thin) return meets_in_plane(p, d, t, n);
  const Vec3 x = p + std::clamp(above_p / (above_p - above_q), 0.0, 1.0) * d;
  for (std::size_t i = 0; i < 3; ++i)
    if (n.dot((t[(i + 1) % 3] - t[i]).cross(x - t[i])) < -touch * area * area) return false;
  return true;
}

}  // namespace

bool crosses_itself(const TriangleMesh& mesh, const Bvh& bvh) {
  const auto vertex = [&](Index v) -> const Vec3& { return mesh.vertices[static_cast<std::size_t>(v)]; };
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const Index u = t[i], v = t[(i + 1) % 3];
      if (u > v) continue;  // the neighbour's turn, where the surface is closed and oriented
      Box box;
      box.add(vertex(u));
      box.add(vertex(v));
      const bool found = bvh.any_in(box, [&](Index other) {
        const Triangle& o = mesh.triangles[static_cast<std::size_t>(other)];
        for (const Index w : o)
          if (w == u || w == v) return false;
        return meets(vertex(u), vertex(v), {vertex(o[0]), vertex(o[1]), vertex(o[2])});
      });
      if (found) return true;
    }
  return false;
}

}  // namespace palpate
