#include "palpate/geometry/triangle_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <unordered_map>

namespace palpate {

namespace {

struct Position {
  std::array<std::uint64_t, 3> bits;
  explicit Position(const Vec3& p) {
    for (int i = 0; i < 3; ++i) {
      const double x = p[i] + 0.0;  // -0 + 0 = 0
      std::memcpy(&bits[static_cast<std::size_t>(i)], &x, sizeof x);
    }
  }
  bool operator==(const Position&) const = default;
};

struct PositionHash {
  std::size_t operator()(const Position& p) const {
    std::uint64_t h = 0;
    for (const std::uint64_t b : p.bits) h = (h ^ b) * 0x9e3779b97f4a7c15u, h ^= h >> 32;
    return h;
  }
};

}  // namespace

WeldReport weld(TriangleMesh& mesh) {
  WeldReport report;
  std::unordered_map<Position, Index, PositionHash> first;
  first.reserve(mesh.vertices.size());
  std::vector<Index> representative(mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const auto [it, added] = first.try_emplace(Position(mesh.vertices[i]), static_cast<Index>(i));
    representative[i] = it->second;
    if (!added) ++report.welded;
  }

  const std::size_t before = mesh.triangles.size();
  std::erase_if(mesh.triangles, [&](Triangle& t) {
    for (Index& v : t) v = representative[static_cast<std::size_t>(v)];
    return t[0] == t[1] || t[1] == t[2] || t[2] == t[0] || !(area_vector(mesh, t).norm() > 0);
  });
  report.degenerate = before - mesh.triangles.size();

  std::vector<Index> number(mesh.vertices.size(), -1);
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) number[static_cast<std::size_t>(v)] = 0;
  Index used = 0;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (number[i] < 0) {
      if (representative[i] == static_cast<Index>(i)) ++report.unused;
      continue;
    }
    mesh.vertices[static_cast<std::size_t>(used)] = mesh.vertices[i];
    number[i] = used++;
  }
  mesh.vertices.resize(static_cast<std::size_t>(used));
  for (Triangle& t : mesh.triangles)
    for (Index& v : t) v = number[static_cast<std::size_t>(v)];
  return report;
}

Vec3 area_vector(const TriangleMesh& mesh, const Triangle& t) {
  const Vec3& a = mesh.vertices[static_cast<std::size_t>(t[0])];
  return 0.5 * (mesh.vertices[static_cast<std::size_t>(t[1])] - a)
                   .cross(mesh.vertices[static_cast<std::size_t>(t[2])] - a);
}

double volume(const TriangleMesh& mesh) {
  if (mesh.vertices.empty()) return 0;
  const Vec3 origin = mesh.vertices[0];  // near the mesh: fewer digits lost far from the frame's origin
  double sum = 0;
  for (const Triangle& t : mesh.triangles)
    sum += area_vector(mesh, t).dot(mesh.vertices[static_cast<std::size_t>(t[0])] - origin);
  return sum / 3;
}

std::vector<double> vertex_areas(const TriangleMesh& mesh) {
  std::vector<double> areas(mesh.vertices.size(), 0.0);
  for (const Triangle& t : mesh.triangles) {
    const double third = area_vector(mesh, t).norm() / 3;
    for (const Index v : t) areas[static_cast<std::size_t>(v)] += third;
  }
  return areas;
}

std::vector<Vec3> vertex_normals(const TriangleMesh& mesh) {
  std::vector<Vec3> normals(mesh.vertices.size(), Vec3::Zero());
  for (const Triangle& t : mesh.triangles) {
    const Vec3 n = area_vector(mesh, t).normalized();
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3& p = mesh.vertices[static_cast<std::size_t>(t[i])];
      const Vec3 u = mesh.vertices[static_cast<std::size_t>(t[(i + 1) % 3])] - p;
      const Vec3 v = mesh.vertices[static_cast<std::size_t>(t[(i + 2) % 3])] - p;
      normals[static_cast<std::size_t>(t[i])] += std::atan2(u.cross(v).norm(), u.dot(v)) * n;
    }
  }
  for (Vec3& n : normals)
    if (n.norm() > 0) n.normalize();
  return normals;
}

void append(TriangleMesh& a, const TriangleMesh& b) {
  const auto offset = static_cast<Index>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const Triangle& t : b.triangles) a.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
}

}  // namespace palpate
