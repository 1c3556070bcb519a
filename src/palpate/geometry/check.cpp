#include "palpate/geometry/check.hpp"

#include <algorithm>
#include <numeric>

namespace palpate {

namespace {

// An edge as one of its triangles runs through it: key holds the two vertices, lower first.
struct Edge {
  std::uint64_t key;
  std::uint8_t forward;  // from the lower vertex to the higher
};

std::vector<Edge> sorted_edges(const TriangleMesh& mesh) {
  std::vector<Edge> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const auto u = static_cast<std::uint64_t>(t[i]), v = static_cast<std::uint64_t>(t[(i + 1) % 3]);
      edges.push_back({std::min(u, v) << 32 | std::max(u, v), u < v});
    }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) { return a.key < b.key; });
  return edges;
}

}  // namespace

std::vector<Index> components(const TriangleMesh& mesh) {
  std::vector<Index> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](Index v) {
    auto at = [&](Index i) -> Index& { return parent[static_cast<std::size_t>(i)]; };
    while (at(v) != v) v = at(v) = at(at(v));
    return v;
  };
  for (const Triangle& t : mesh.triangles)
    for (const Index v : {t[1], t[2]}) {
      const Index a = root(t[0]), b = root(v);
      parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }
  std::vector<Index> number(mesh.vertices.size(), -1), component;
  component.reserve(mesh.triangles.size());
  Index next = 0;
  for (const Triangle& t : mesh.triangles) {
    Index& n = number[static_cast<std::size_t>(root(t[0]))];
    if (n < 0) n = next++;
    component.push_back(n);
  }
  return component;
}

std::size_t drop_duplicates(TriangleMesh& mesh) {
  struct Corners {
    Triangle sorted;
    Index triangle;
  };
  std::vector<Corners> all;
  all.reserve(mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    all.push_back({mesh.triangles[i], static_cast<Index>(i)});
    std::sort(all.back().sorted.begin(), all.back().sorted.end());
  }
  std::sort(all.begin(), all.end(), [](const Corners& a, const Corners& b) {
    return a.sorted != b.sorted ? a.sorted < b.sorted : a.triangle < b.triangle;
  });
  std::vector<char> drop(mesh.triangles.size(), 0);
  std::size_t count = 0;
  for (std::size_t i = 1; i < all.size(); ++i)
    if (all[i].sorted == all[i - 1].sorted) drop[static_cast<std::size_t>(all[i].triangle)] = 1, ++count;
  if (count > 0) {
    std::size_t i = 0;
    std::erase_if(mesh.triangles, [&](const Triangle&) { return drop[i++] != 0; });
  }
  return count;
}

MeshReport check(const TriangleMesh& mesh) {
  MeshReport report;
  report.vertices = mesh.vertices.size();
  report.triangles = mesh.triangles.size();
  report.box = bounding_box(mesh.vertices);
  const std::vector<Index> component = components(mesh);
  for (const Index c : component)
    report.components = std::max(report.components, static_cast<std::size_t>(c) + 1);

  const std::vector<Edge> edges = sorted_edges(mesh);
  for (std::size_t i = 0, j; i < edges.size(); i = j) {
    std::size_t forward = 0;
    for (j = i; j < edges.size() && edges[j].key == edges[i].key; ++j) forward += edges[j].forward;
    if (j - i == 1) ++report.open_edges;
    if (j - i == 2 && forward != 1) ++report.flipped_edges;
    if (j - i > 2) ++report.nonmanifold_edges;
  }
  TriangleMesh unique{{}, mesh.triangles};
  report.duplicate_triangles = drop_duplicates(unique);

  for (const Triangle& t : mesh.triangles) {
    const Vec3 a = area_vector(mesh, t);
    report.area += a.norm();
    report.area_sum += a;
  }
  report.volume = volume(mesh);
  return report;
}

}  // namespace palpate
