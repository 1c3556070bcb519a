#include "palpate/pad/input.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/geometry/check.hpp"

namespace palpate {

void require_numbers(const TriangleMesh& mesh, const std::string& what) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
    if (!(mesh.vertices[i].cwiseAbs().maxCoeff() < 1e60))
      throw Error(ErrorKind::geometry, "{}: vertex {} has a coordinate that is no usable number", what, i);
  std::vector<char> used(mesh.vertices.size(), 0);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (const Index v : mesh.triangles[i]) {
      if (v < 0 || static_cast<std::size_t>(v) >= mesh.vertices.size())
        throw Error(ErrorKind::geometry, "{}: triangle {} uses vertex {}, of {}", what, i, v,
                    mesh.vertices.size());
      used[static_cast<std::size_t>(v)] = 1;
    }
  const auto unused = std::find(used.begin(), used.end(), 0);
  if (unused != used.end())
    throw Error(ErrorKind::geometry, "{}: no triangle uses vertex {}; weld the surface first", what,
                unused - used.begin());
}

void require_closed(const TriangleMesh& mesh, const std::string& what) {
  const MeshReport r = check(mesh);
  if (r.triangles < 4)
    throw Error(ErrorKind::geometry, "{} has {} triangles, too few to enclose anything", what, r.triangles);
  if (r.open_edges > 0)
    throw Error(
        ErrorKind::geometry,
        "{} is open: {} edges have one triangle only; close the holes, weld vertices at the same place", what,
        r.open_edges);
  if (r.nonmanifold_edges > 0)
    throw Error(ErrorKind::geometry,
                "{}: {} edges have three triangles or more; remove inner walls and doubled triangles", what,
                r.nonmanifold_edges);
  if (r.flipped_edges > 0)
    throw Error(ErrorKind::geometry, "{}: triangles face opposite ways across {} edges; orient them alike",
                what, r.flipped_edges);
  if (!(std::abs(r.volume) > 1e-12 * std::pow(r.box.diagonal(), 3)))
    throw Error(ErrorKind::geometry, "{} encloses no volume", what);
}

void require_names(const PadOptions& options, const std::vector<NamedSurface>& inner) {
  std::vector<std::string> names{options.name};
  for (const NamedSurface& s : inner) {
    if (s.name.empty() || std::count(names.begin(), names.end(), s.name))
      throw Error(ErrorKind::usage, "region name \"{}\" is empty or given twice", s.name);
    names.push_back(s.name);
  }
}

}  // namespace palpate
