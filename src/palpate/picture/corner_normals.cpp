#include "palpate/picture/corner_normals.hpp"

#include <cmath>

namespace palpate {
namespace {

Vec3 unit(const Vec3& v) {
  const double length = v.norm();
  return length > 0 ? Vec3(v / length) : Vec3(Vec3::Zero());
}

}  // namespace

std::vector<Vec3f> corner_normals(std::span<const Vec3> vertices, std::span<const Triangle> triangles,
                                  double crease) {
  const std::size_t count = triangles.size();
  std::vector<Vec3> normals(count);
  std::vector<double> angles(3 * count);
  std::vector<std::size_t> first(vertices.size() + 1, 0);
  for (std::size_t t = 0; t < count; ++t) {
    const Triangle& tri = triangles[t];
    const Vec3 &a = vertices[tri[0]], &b = vertices[tri[1]], &c = vertices[tri[2]];
    normals[t] = unit((b - a).cross(c - a));
    for (int k = 0; k < 3; ++k) {
      const Vec3& corner = vertices[tri[k]];
      const Vec3 u = vertices[tri[(k + 1) % 3]] - corner, v = vertices[tri[(k + 2) % 3]] - corner;
      angles[3 * t + k] = std::atan2(u.cross(v).norm(), u.dot(v));
      ++first[tri[k] + 1];
    }
  }
  for (std::size_t v = 0; v < vertices.size(); ++v) first[v + 1] += first[v];
  std::vector<std::size_t> corners(3 * count), next(first.begin(), first.end() - 1);
  for (std::size_t c = 0; c < 3 * count; ++c) corners[next[triangles[c / 3][c % 3]]++] = c;

  const double limit = std::cos(crease * M_PI / 180);
  std::vector<Vec3f> result(3 * count);
  for (std::size_t c = 0; c < 3 * count; ++c) {
    const std::size_t vertex = triangles[c / 3][c % 3];
    Vec3 sum = Vec3::Zero();
    for (std::size_t i = first[vertex]; i < first[vertex + 1]; ++i) {
      const Vec3& other = normals[corners[i] / 3];
      if (other.dot(normals[c / 3]) >= limit) sum += angles[corners[i]] * other;
    }
    result[c] = unit(sum).cast<float>();
  }
  return result;
}

}  // namespace palpate
