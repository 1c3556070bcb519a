#include "palpate/geometry/tet_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {

// Faces opposite corners 0..3, counter-clockwise seen from outside.
constexpr std::array<std::array<std::size_t, 3>, 4> tet_faces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

const Vec3& node(const TetMesh& mesh, Index i) { return mesh.nodes[static_cast<std::size_t>(i)]; }

// The six dihedral angles in degrees: between the outward normals of each pair of faces, taken from 180.
std::array<double, 6> dihedrals(const TetMesh& mesh, const Tetrahedron& t) {
  std::array<Vec3, 4> normal;
  for (std::size_t f = 0; f < 4; ++f) {
    const auto& [a, b, c] = tet_faces[f];
    normal[f] = (node(mesh, t[b]) - node(mesh, t[a])).cross(node(mesh, t[c]) - node(mesh, t[a]));
  }
  std::array<double, 6> angles;
  std::size_t k = 0;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = i + 1; j < 4; ++j)
      angles[k++] = 180 - std::atan2(normal[i].cross(normal[j]).norm(), normal[i].dot(normal[j])) * 180 /
                              std::numbers::pi;
  return angles;
}

}  // namespace

double six_volume(const TetMesh& mesh, const Tetrahedron& t) {
  const Vec3& a = node(mesh, t[0]);
  return (node(mesh, t[1]) - a).cross(node(mesh, t[2]) - a).dot(node(mesh, t[3]) - a);
}

Boundary boundary(const TetMesh& mesh) {
  struct Face {
    std::array<Index, 3> sorted;
    Triangle corners;
  };
  std::vector<Face> faces;
  faces.reserve(4 * mesh.tets.size());
  for (const Tetrahedron& t : mesh.tets)
    for (const auto& [a, b, c] : tet_faces) {
      Face face{{t[a], t[b], t[c]}, {t[a], t[b], t[c]}};
      std::sort(face.sorted.begin(), face.sorted.end());
      faces.push_back(face);
    }
  std::stable_sort(faces.begin(), faces.end(),
                   [](const Face& x, const Face& y) { return x.sorted < y.sorted; });

  Boundary result;
  std::vector<Index> number(mesh.nodes.size(), -1);
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t j = i + 1;
    while (j < faces.size() && faces[j].sorted == faces[i].sorted) ++j;
    if (j == i + 1) {
      result.surface.triangles.push_back(faces[i].corners);
      for (const Index v : faces[i].corners) number[static_cast<std::size_t>(v)] = 0;
    }
    i = j;
  }
  for (std::size_t v = 0; v < number.size(); ++v)
    if (number[v] == 0) {
      number[v] = static_cast<Index>(result.nodes.size());
      result.nodes.push_back(static_cast<Index>(v));
      result.surface.vertices.push_back(mesh.nodes[v]);
    }
  for (Triangle& t : result.surface.triangles)
    for (Index& v : t) v = number[static_cast<std::size_t>(v)];
  return result;
}

TetQuality quality(const TetMesh& mesh) {
  TetQuality q;
  q.min_dihedral = 180;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    const double v = six_volume(mesh, mesh.tets[i]) / 6;
    q.volume += v;
    if (!(v > 0) && ++q.inverted <= 10) q.inverted_at.push_back(static_cast<Index>(i));
    q.min_volume = i == 0 ? v : std::min(q.min_volume, v);
    q.max_volume = i == 0 ? v : std::max(q.max_volume, v);
    double smallest = 180;
    for (const double angle : dihedrals(mesh, mesh.tets[i])) {
      smallest = std::min(smallest, angle);
      q.max_dihedral = std::max(q.max_dihedral, angle);
      ++q.histogram[static_cast<std::size_t>(std::clamp(angle / 10, 0.0, 17.0))];
    }
    if (smallest < 5) ++q.slivers;
    if (smallest < q.min_dihedral) q.min_dihedral = smallest, q.worst = static_cast<Index>(i);
  }
  if (mesh.tets.empty()) q.min_dihedral = 0;
  const double mean = q.volume / static_cast<double>(std::max<std::size_t>(mesh.tets.size(), 1));
  for (const Tetrahedron& t : mesh.tets) {
    const double log = std::log2(std::max(six_volume(mesh, t) / 6 / mean, 1e-30));  // NaN: the first bin
    ++q.volumes[log >= -10 ? static_cast<std::size_t>(std::min(log + 11, 16.0)) : 0];
  }
  return q;
}

void require_valid(const TetMesh& mesh, const std::string& what) {
  if (mesh.tets.empty()) throw Error(ErrorKind::geometry, "{}: no tetrahedra", what);
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    if (!mesh.nodes[i].allFinite())
      throw Error(ErrorKind::geometry, "{}: node {} has a coordinate that is no number", what, i);
  if (mesh.regions.size() != mesh.tets.size())
    throw Error(ErrorKind::geometry, "{}: {} tetrahedra but {} region entries", what, mesh.tets.size(),
                mesh.regions.size());
  const double size = bounding_box(mesh.nodes).diagonal();
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    for (const Index v : mesh.tets[i])
      if (v < 0 || static_cast<std::size_t>(v) >= mesh.nodes.size())
        throw Error(ErrorKind::geometry, "{}: tetrahedron {} uses node {}, of {}", what, i, v,
                    mesh.nodes.size());
    if (mesh.regions[i] < 0 || static_cast<std::size_t>(mesh.regions[i]) >= mesh.region_names.size())
      throw Error(ErrorKind::geometry, "{}: tetrahedron {} is in region {}, of {}", what, i, mesh.regions[i],
                  mesh.region_names.size());
    const double v = six_volume(mesh, mesh.tets[i]);
    if (!(v > 1e-18 * size * size * size))
      throw Error(ErrorKind::geometry,
                  "{}: tetrahedron {} (nodes {} {} {} {}) is {}; repair the mesh or remove it", what, i,
                  mesh.tets[i][0], mesh.tets[i][1], mesh.tets[i][2], mesh.tets[i][3],
                  v < 0 ? "inverted" : "flat");
  }
}

}  // namespace palpate
