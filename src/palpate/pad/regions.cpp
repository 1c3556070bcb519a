// Jacobson, Kavan, Sorkine, "Robust inside-outside segmentation using generalized winding numbers" (2013).
#include "palpate/pad/regions.hpp"

#include <algorithm>
#include <numeric>
#include <optional>

#include "palpate/geometry/winding_number.hpp"

namespace palpate {

namespace {

constexpr std::array<std::array<std::size_t, 3>, 4> faces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

// A face of a tetrahedron (seen from outside of it) or a triangle of the surface (tet -1). `even`: whether
// the corners are an even permutation of the sorted ones.
struct Side {
  Triangle sorted;
  Index tet;
  bool even;
};

Side make_side(Triangle t, Index tet) {
  bool even = true;
  for (const auto& [i, j] : {std::pair<std::size_t, std::size_t>{0, 1}, {1, 2}, {0, 1}})
    if (t[i] > t[j]) std::swap(t[i], t[j]), even = !even;
  return {t, tet, even};
}

std::size_t root(std::vector<Index>& parent, Index t) {
  auto i = static_cast<std::size_t>(t);
  while (parent[i] != static_cast<Index>(i)) {
    parent[i] = parent[static_cast<std::size_t>(parent[i])];
    i = static_cast<std::size_t>(parent[i]);
  }
  return i;
}

}  // namespace

std::vector<char> inside(const FlipMesh& mesh, std::span<const Triangle> triangles,
                         const TriangleMesh& surface) {
  const std::size_t n = mesh.tets().size();
  std::vector<Side> sides;
  sides.reserve(4 * n + triangles.size());
  for (std::size_t t = 0; t < n; ++t)
    if (mesh.alive(static_cast<Index>(t)))
      for (const auto& [i, j, k] : faces) {
        const Tetrahedron& x = mesh.tets()[t];
        sides.push_back(make_side({x[i], x[j], x[k]}, static_cast<Index>(t)));
      }
  for (const Triangle& t : triangles) sides.push_back(make_side(t, -1));
  std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
    return std::tie(x.sorted, x.tet) < std::tie(y.sorted, y.tet);
  });

  // Parts connected through faces that are no wall; at walls each side votes.
  std::vector<Index> parent(n);
  std::iota(parent.begin(), parent.end(), 0);
  std::vector<std::array<int, 2>> votes(n, {0, 0});  // outside, inside
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t j = i + 1;
    while (j < sides.size() && sides[j].sorted == sides[i].sorted) ++j;
    if (sides[i].tet < 0) {
      for (std::size_t k = i + 1; k < j; ++k)
        if (sides[k].tet >= 0)
          ++votes[static_cast<std::size_t>(sides[k].tet)][sides[k].even == sides[i].even];
    } else if (j == i + 2) {
      const std::size_t a = root(parent, sides[i].tet), b = root(parent, sides[i + 1].tet);
      parent[std::max(a, b)] = static_cast<Index>(std::min(a, b));
    }
    i = j;
  }
  std::vector<std::array<int, 2>> total(n, {0, 0});
  for (std::size_t t = 0; t < n; ++t)
    for (std::size_t s = 0; s < 2; ++s) total[root(parent, static_cast<Index>(t))][s] += votes[t][s];

  std::vector<char> result(n, 0);
  std::optional<WindingNumber> winding;
  for (std::size_t t = 0; t < n; ++t) {
    if (!mesh.alive(static_cast<Index>(t))) continue;
    const std::array<int, 2>& all = total[root(parent, static_cast<Index>(t))];
    if ((all[0] == 0) != (all[1] == 0)) {
      result[t] = all[1] > 0;
    } else if ((votes[t][0] == 0) != (votes[t][1] == 0)) {
      result[t] = votes[t][1] > 0;
    } else {
      Vec3 centroid = Vec3::Zero();
      for (const Index v : mesh.tets()[t]) centroid += mesh.node(v) / 4;
      if (!winding) winding.emplace(surface);
      result[t] = winding->at(centroid) > 0.5;
    }
  }
  return result;
}

}  // namespace palpate
