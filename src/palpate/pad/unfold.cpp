// Laplacian smoothing of the crossing triangles only: Field, "Laplacian smoothing and Delaunay
// triangulations" (1988).
#include "palpate/pad/unfold.hpp"

#include <algorithm>
#include <set>

#include "palpate/base/error.hpp"
#include "palpate/pad/crossings.hpp"

namespace palpate {

namespace {

constexpr int rounds = 60;
constexpr int rounds_a_ring = 10;  // then the neighbourhood grows
constexpr std::size_t most_crossings = 10000;
constexpr std::size_t most_part = 5;  // more than a fifth of the vertices is no place any more

std::vector<std::vector<Index>> neighbours(const TriangleMesh& mesh) {
  std::vector<std::vector<Index>> lists(mesh.vertices.size());
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      auto& list = lists[static_cast<std::size_t>(t[k])];
      list.push_back(t[(k + 1) % 3]), list.push_back(t[(k + 2) % 3]);
    }
  for (auto& list : lists) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return lists;
}

std::set<Index> grown(const std::set<Index>& set, const std::vector<std::vector<Index>>& around) {
  std::set<Index> result = set;
  for (const Index v : set)
    result.insert(around[static_cast<std::size_t>(v)].begin(), around[static_cast<std::size_t>(v)].end());
  return result;
}

}  // namespace

Unfolded unfold(TriangleMesh& mesh) {
  const auto around = neighbours(mesh);
  const std::vector<Vec3> before = mesh.vertices;
  Unfolded report;
  std::vector<Crossing> found = crossings(mesh.vertices, mesh.triangles, most_crossings);
  report.crossings = found.size();
  for (int round = 0; !found.empty(); ++round) {
    std::set<Index> vertices;
    for (const Crossing& c : found)
      for (const Index t : {c.edge_of, c.through})
        for (const Index v : mesh.triangles[static_cast<std::size_t>(t)]) vertices.insert(v);
    for (int ring = 0; ring < round / rounds_a_ring; ++ring) vertices = grown(vertices, around);
    if (round == rounds || found.size() == most_crossings || most_part * vertices.size() > before.size())
      throw Error(
          ErrorKind::geometry,
          "smoothing does not free the surface from itself: of {} crossings {} are left, the first near "
          "({:.6g}, {:.6g}, {:.6g}); separate or unite the parts there",
          report.crossings, found.size(), found[0].at.x(), found[0].at.y(), found[0].at.z());
    const std::vector<Vec3> old = mesh.vertices;
    for (const Index v : vertices) {
      Vec3 middle = Vec3::Zero();
      for (const Index n : around[static_cast<std::size_t>(v)]) middle += old[static_cast<std::size_t>(n)];
      mesh.vertices[static_cast<std::size_t>(v)] =
          middle / static_cast<double>(around[static_cast<std::size_t>(v)].size());
    }
    found = crossings(mesh.vertices, mesh.triangles, most_crossings);
  }
  for (std::size_t i = 0; i < before.size(); ++i) {
    const double d = (mesh.vertices[i] - before[i]).norm();
    report.moved += d > 0;
    report.farthest = std::max(report.farthest, d);
  }
  return report;
}

}  // namespace palpate
