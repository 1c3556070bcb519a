#include "palpate/geometry/shapes.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {

constexpr double pi = std::numbers::pi;

struct Icosahedron {
  std::array<Vec3, 12> vertices;
  std::array<Triangle, 20> triangles;
};

Icosahedron icosahedron() {
  Icosahedron result;
  const double g = std::numbers::phi;
  std::size_t n = 0;
  for (const double s : {-1.0, 1.0})
    for (const double t : {-g, g}) {
      result.vertices[n++] = Vec3(0, s, t).normalized();
      result.vertices[n++] = Vec3(s, t, 0).normalized();
      result.vertices[n++] = Vec3(t, 0, s).normalized();
    }
  n = 0;
  const auto near = [&](std::size_t i, std::size_t j) {
    return result.vertices[i].dot(result.vertices[j]) > 0.4;  // neighbours: 1/sqrt(5)
  };
  for (std::size_t i = 0; i < 12; ++i)
    for (std::size_t j = i + 1; j < 12; ++j)
      for (std::size_t k = j + 1; k < 12; ++k)
        if (near(i, j) && near(j, k) && near(k, i)) {
          const auto& v = result.vertices;
          Triangle t{static_cast<Index>(i), static_cast<Index>(j), static_cast<Index>(k)};
          if (v[i].cross(v[j]).dot(v[k]) < 0) std::swap(t[1], t[2]);
          result.triangles[n++] = t;
        }
  return result;
}

// Grid of n x n squares on the parallelogram origin, u, v, two triangles each, facing u x v.
void append_patch(TriangleMesh& mesh, const Vec3& origin, const Vec3& u, const Vec3& v, int n) {
  const auto first = static_cast<Index>(mesh.vertices.size());
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) mesh.vertices.push_back(origin + (u * i + v * j) / n);
  const auto at = [&](int i, int j) { return first + i * (n + 1) + j; };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
}

void require(bool good, const char* what) {
  if (!good) throw Error(ErrorKind::usage, "{}", what);
}

}  // namespace

TriangleMesh make_sphere(const Vec3& center, double radius, int rings, int segments) {
  require(rings >= 2 && segments >= 3, "a sphere needs at least 2 rings and 3 segments");
  TriangleMesh mesh;
  mesh.vertices.push_back(center + Vec3(0, 0, radius));
  for (int i = 1; i < rings; ++i)
    for (int j = 0; j < segments; ++j) {
      const double theta = pi * i / rings, phi = 2 * pi * j / segments;
      mesh.vertices.push_back(center + radius * Vec3(std::sin(theta) * std::cos(phi),
                                                     std::sin(theta) * std::sin(phi), std::cos(theta)));
    }
  mesh.vertices.push_back(center - Vec3(0, 0, radius));
  const auto last = static_cast<Index>(mesh.vertices.size() - 1);
  const auto at = [&](int i, int j) { return 1 + (i - 1) * segments + j % segments; };
  for (int j = 0; j < segments; ++j) {
    mesh.triangles.push_back({0, at(1, j), at(1, j + 1)});
    for (int i = 1; i + 1 < rings; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
    mesh.triangles.push_back({at(rings - 1, j), last, at(rings - 1, j + 1)});
  }
  return mesh;
}

TriangleMesh make_torus(double major_radius, double minor_radius, int major_segments, int minor_segments) {
  require(major_segments >= 3 && minor_segments >= 3, "a torus needs at least 3 segments each way");
  TriangleMesh mesh;
  for (int i = 0; i < major_segments; ++i)
    for (int j = 0; j < minor_segments; ++j) {
      const double u = 2 * pi * i / major_segments, v = 2 * pi * j / minor_segments;
      const double r = major_radius + minor_radius * std::cos(v);
      mesh.vertices.push_back(Vec3(r * std::cos(u), minor_radius * std::sin(v), r * std::sin(u)));
    }
  const auto at = [&](int i, int j) { return (i % major_segments) * minor_segments + j % minor_segments; };
  for (int i = 0; i < major_segments; ++i)
    for (int j = 0; j < minor_segments; ++j) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
      mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
    }
  return mesh;
}

TriangleMesh make_box(const Box& box, int n) {
  require(n >= 1 && !box.empty(), "a box needs a size and at least one square a side");
  TriangleMesh mesh;
  const Vec3 x(box.size().x(), 0, 0), y(0, box.size().y(), 0), z(0, 0, box.size().z());
  append_patch(mesh, box.min, y, x, n), append_patch(mesh, box.min, z, y, n);
  append_patch(mesh, box.min, x, z, n), append_patch(mesh, box.max, -x, -y, n);
  append_patch(mesh, box.max, -y, -z, n), append_patch(mesh, box.max, -z, -x, n);
  // Edges come from both sides with different rounding: exact again, so that welding finds them.
  for (Vec3& p : mesh.vertices)
    for (int k = 0; k < 3; ++k)
      p[k] = box.min[k] + box.size()[k] * std::round((p[k] - box.min[k]) / box.size()[k] * n) / n;
  weld(mesh);
  return mesh;
}

TriangleMesh make_star_shaped(const Vec3& center, int frequency,
                              const std::function<double(const Vec3& direction)>& radius) {
  require(frequency >= 1 && frequency <= 10000, "the frequency of a subdivided icosahedron is 1 to 10000");
  const Icosahedron base = icosahedron();
  const int f = frequency;
  const double angle = std::acos(1 / std::sqrt(5.0));  // between neighbouring corners
  TriangleMesh mesh;
  std::map<std::array<Index, 3>, Index> on_edges;  // (corner, corner, steps from the lower) -> vertex
  for (const Triangle& t : base.triangles) {
    std::vector<Index> number;
    const auto at = [&](int i, int j) { return number[static_cast<std::size_t>(i * (i + 1) / 2 + j)]; };
    for (int i = 0; i <= f; ++i)
      for (int j = 0; j <= i; ++j) {
        const std::array<int, 3> w{f - i, i - j, j};  // barycentric, of f
        std::array<Index, 3> key{-1, -1, -1};
        for (std::size_t a = 0; a < 3; ++a) {
          const std::size_t b = (a + 1) % 3;
          if (w[a] == f)
            key = {t[a], t[a], 0};
          else if (w[a] + w[b] == f && w[a] && w[b])
            key =
                t[a] < t[b] ? std::array<Index, 3>{t[a], t[b], w[b]} : std::array<Index, 3>{t[b], t[a], w[a]};
        }
        const auto next = static_cast<Index>(mesh.vertices.size());
        if (key[0] >= 0) {
          const auto [entry, fresh] = on_edges.emplace(key, next);
          number.push_back(entry->second);
          if (!fresh) continue;
        } else {
          number.push_back(next);
        }
        // Weights by the sine spread the vertices more evenly than straight subdivision.
        Vec3 d = Vec3::Zero();
        for (std::size_t a = 0; a < 3; ++a)
          d += std::sin(angle * w[a] / f) * base.vertices[static_cast<std::size_t>(t[a])];
        d.normalize();
        mesh.vertices.push_back(center + radius(d) * d);
      }
    for (int i = 0; i < f; ++i)
      for (int j = 0; j <= i; ++j) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        if (j < i) mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      }
  }
  return mesh;
}

TetMesh make_block(const Box& box, const std::array<int, 3>& cells) {
  require(!box.empty() && cells[0] >= 1 && cells[1] >= 1 && cells[2] >= 1,
          "a block needs a size and at least one cell a side");
  TetMesh mesh;
  mesh.region_names = {"tissue"};
  const auto at = [&](int i, int j, int k) { return (i * (cells[1] + 1) + j) * (cells[2] + 1) + k; };
  const Vec3 n(cells[0], cells[1], cells[2]);
  for (int i = 0; i <= cells[0]; ++i)
    for (int j = 0; j <= cells[1]; ++j)
      for (int k = 0; k <= cells[2]; ++k)
        mesh.nodes.push_back(box.min + box.size().cwiseProduct(Vec3(i, j, k).cwiseQuotient(n)));
  // Kuhn: one tetrahedron for each order of walking the three axes from a cell's lowest to its highest
  // corner.
  constexpr std::array<std::array<std::size_t, 3>, 6> orders{
      {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {1, 0, 2}, {0, 2, 1}, {2, 1, 0}}};
  for (int i = 0; i < cells[0]; ++i)
    for (int j = 0; j < cells[1]; ++j)
      for (int k = 0; k < cells[2]; ++k)
        for (std::size_t o = 0; o < 6; ++o) {
          std::array<int, 3> c{i, j, k};
          Tetrahedron t{at(i, j, k), 0, 0, 0};
          for (std::size_t s = 0; s < 3; ++s) ++c[orders[o][s]], t[s + 1] = at(c[0], c[1], c[2]);
          if (o >= 3) std::swap(t[2], t[3]);  // odd orders are left-handed
          mesh.tets.push_back(t);
        }
  mesh.regions.assign(mesh.tets.size(), 0);
  return mesh;
}

}  // namespace palpate
