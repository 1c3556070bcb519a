// Meshes of the tests, where the shapes of the library are not what is wanted.
#pragma once

#include <cmath>
#include <numbers>
#include <random>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate::test {

// Random triangles in the unit cube, connected nowhere.
inline TriangleMesh soup(int triangles, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  TriangleMesh mesh;
  for (int i = 0; i < triangles; ++i) {
    const Vec3 a(u(random), u(random), u(random));
    for (int k = 0; k < 3; ++k) mesh.vertices.push_back(a + 0.1 * Vec3(u(random), u(random), u(random)));
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

inline Index wrap(int i, int n) { return ((i % n) + n) % n; }

// About the z axis, facing outwards.
inline TriangleMesh torus(double major, double minor, int m, int n) {
  TriangleMesh mesh;
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < n; ++j) {
      const double u = 2 * std::numbers::pi * i / m, v = 2 * std::numbers::pi * j / n;
      const double r = major + minor * std::cos(v);
      mesh.vertices.push_back({r * std::cos(u), r * std::sin(u), minor * std::sin(v)});
      const Index a = wrap(i, m) * n + wrap(j, n), b = wrap(i + 1, m) * n + wrap(j, n),
                  c = wrap(i + 1, m) * n + wrap(j + 1, n), d = wrap(i, m) * n + wrap(j + 1, n);
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  return mesh;
}

// Cube of side 2 r about c, facing outwards.
inline TriangleMesh cube(const Vec3& c, double r) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.vertices.push_back(c + r * Vec3(i & 4 ? 1 : -1, i & 2 ? 1 : -1, i & 1 ? 1 : -1));
  for (const auto& [a, b, d, e] : {std::array{4, 6, 7, 5}, std::array{0, 1, 3, 2}, std::array{2, 3, 7, 6},
                                   std::array{0, 4, 5, 1}, std::array{1, 5, 7, 3}, std::array{0, 2, 6, 4}}) {
    mesh.triangles.push_back({a, b, d});
    mesh.triangles.push_back({a, d, e});
  }
  return mesh;
}

inline TriangleMesh flipped(TriangleMesh mesh) {
  for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

inline TriangleMesh both(TriangleMesh a, const TriangleMesh& b) {
  append(a, b);
  return a;
}

}  // namespace palpate::test
