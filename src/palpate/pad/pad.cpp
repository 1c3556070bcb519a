#include "palpate/pad/pad.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "palpate/geometry/check.hpp"
#include "palpate/pad/crossings.hpp"
#include "palpate/pad/delaunay.hpp"
#include "palpate/pad/fill.hpp"
#include "palpate/pad/flips.hpp"
#include "palpate/pad/improve.hpp"
#include "palpate/pad/input.hpp"
#include "palpate/pad/recover.hpp"
#include "palpate/pad/regions.hpp"

namespace palpate {

namespace {

constexpr std::size_t most_points = 5000000;
const double goal = std::sin(18 * M_PI / 180);  // dihedral angles beyond this are worth no more work
constexpr double coarser = 1.4;  // interior points by default than the surface: few nodes, still good shapes
constexpr double flat = 1e-3;    // shape below which a tetrahedron must go

double mean_edge(const TriangleMesh& mesh) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k)
      sum += (mesh.vertices[static_cast<std::size_t>(t[k])] -
              mesh.vertices[static_cast<std::size_t>(t[(k + 1) % 3])])
                 .norm();
  return sum / (3 * static_cast<double>(mesh.triangles.size()));
}

// All surfaces on common nodes: the outer one's vertices first, in their order.
struct Input {
  std::vector<Vec3> nodes;
  std::vector<TriangleMesh> surfaces;            // facing outwards
  std::vector<std::string> names;                // for messages
  std::vector<std::vector<Triangle>> triangles;  // of each surface, by nodes
};

void add_surface(Input& input, const TriangleMesh& mesh, const std::string& what,
                 std::map<std::array<double, 3>, Index>& at) {
  require_numbers(mesh, what);
  require_closed(mesh, what);
  const bool outer = input.surfaces.empty();
  std::vector<Index> number;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Vec3 p = mesh.vertices[i] + Vec3::Zero();  // -0 to 0
    const auto [entry, fresh] =
        at.emplace(std::array{p.x(), p.y(), p.z()}, static_cast<Index>(input.nodes.size()));
    if (fresh)
      input.nodes.push_back(p);
    else if (outer)
      throw Error(ErrorKind::geometry, "{}: vertices {} and {} are at the same place; weld the surface first",
                  what, entry->second, i);
    number.push_back(entry->second);
  }
  input.surfaces.push_back(mesh);
  input.names.push_back(what);
  if (volume(mesh) < 0)
    for (Triangle& t : input.surfaces.back().triangles) std::swap(t[1], t[2]);
  input.triangles.emplace_back();
  for (Triangle t : input.surfaces.back().triangles) {
    for (Index& v : t) v = number[static_cast<std::size_t>(v)];
    input.triangles.back().push_back(t);
  }
}

std::vector<Triangle> all_triangles(const Input& input) {
  std::vector<Triangle> all;
  for (const auto& list : input.triangles) all.insert(all.end(), list.begin(), list.end());
  return all;
}

// Parts of one surface, none running through another: the solid is on the inner side of each, nothing on the
// other. At the middle of a triangle the winding number of all the others is the mean of both sides', 1/2.
void require_nested(const TriangleMesh& mesh, const std::string& what) {
  const std::vector<Index> part = components(mesh);
  const Index parts = part.empty() ? 0 : *std::max_element(part.begin(), part.end()) + 1;
  if (parts < 2) return;
  std::vector<std::pair<double, std::size_t>> largest(static_cast<std::size_t>(parts), {-1, 0});
  for (std::size_t i = 0; i < part.size(); ++i)
    if (const double a = area_vector(mesh, mesh.triangles[i]).norm();
        a > largest[static_cast<std::size_t>(part[i])].first)
      largest[static_cast<std::size_t>(part[i])] = {a, i};
  TriangleMesh others = mesh;
  for (const auto& [area, i] : largest) {
    const Triangle t = mesh.triangles[i];
    others.triangles[i] = {t[0], t[0], t[0]};
    const auto at = [&](std::size_t k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
    const Vec3 middle = (at(0) + at(1) + at(2)) / 3;
    if (const double w = winding_number(others, middle); std::abs(w - 0.5) > 0.1)
      throw Error(
          ErrorKind::geometry,
          "{}: of its {} parts the one at ({:.6g}, {:.6g}, {:.6g}) {}; a cavity faces inwards, separate "
          "solids outwards, a region is a surface of its own",
          what, parts, middle.x(), middle.y(), middle.z(),
          w > 1 ? "faces outwards inside of another" : "faces inwards and is in no other");
    others.triangles[i] = t;
  }
}

// No surface runs through itself or another one, and the inner ones are inside.
void require_apart(const Input& input, const SignedDistanceField& outer) {
  const std::vector<Crossing> found = crossings(input.nodes, all_triangles(input), 1000);
  if (!found.empty()) {
    const auto where = [&](Index t) {
      auto i = static_cast<std::size_t>(t);
      std::size_t s = 0;
      while (i >= input.triangles[s].size()) i -= input.triangles[s++].size();
      return fmt::format("triangle {} of {}", i, input.names[s]);
    };
    const Crossing& c = found.front();
    throw Error(ErrorKind::geometry,
                "surfaces run through each other or themselves at {}{} places, first near ({:.6g}, {:.6g}, "
                "{:.6g}): {} "
                "and {}; separate or unite them, or let `repair` smooth the places",
                found.size() < 1000 ? "" : "over ", found.size(), c.at.x(), c.at.y(), c.at.z(),
                where(c.edge_of), where(c.through));
  }
  for (std::size_t s = 0; s < input.surfaces.size(); ++s) require_nested(input.surfaces[s], input.names[s]);
  const double touch = 1e-9 * bounding_box(input.nodes).diagonal();
  for (std::size_t s = 1; s < input.surfaces.size(); ++s)
    for (std::size_t i = 0; i < input.surfaces[s].vertices.size(); ++i) {
      const double d = outer.at(input.surfaces[s].vertices[i]).distance;
      if (d > touch)
        throw Error(ErrorKind::geometry, "{} leaves the outer surface: its vertex {} is {:.3g} m outside",
                    input.names[s], i, d);
    }
}

TriangleMesh repaired(TriangleMesh mesh, const std::string& what, PadReport& report) {
  require_numbers(mesh, what);
  const Unfolded u = unfold(mesh);
  report.repaired.crossings += u.crossings, report.repaired.moved += u.moved;
  report.repaired.farthest = std::max(report.repaired.farthest, u.farthest);
  return mesh;
}

Input gather(const TriangleMesh& surface, const std::vector<NamedSurface>& inner, const PadOptions& options,
             PadReport& report) {
  if (!(options.spacing >= 0) || !std::isfinite(options.spacing))
    throw Error(ErrorKind::usage, "a spacing of {} m: give a positive one, or 0 for the mean edge",
                options.spacing);
  std::size_t points = surface.vertices.size();
  for (const NamedSurface& s : inner) points += s.surface.vertices.size();
  if (points > most_points)
    throw Error(ErrorKind::resource, "{} surface vertices, of at most {}: simplify the surface", points,
                most_points);
  require_names(options, inner);
  Input input;
  std::map<std::array<double, 3>, Index> at;
  const auto add = [&](const TriangleMesh& mesh, const std::string& what) {
    add_surface(input, options.repair ? repaired(mesh, what, report) : mesh, what, at);
  };
  add(surface, "the surface");
  for (const NamedSurface& s : inner) add(s.surface, "inner surface \"" + s.name + "\"");
  return input;
}

std::vector<Vec3> interior(const Input& input, const SignedDistanceField& outer, const PadOptions& options,
                           PadReport& report, const Progress& progress) {
  report.spacing = options.spacing > 0 ? options.spacing : coarser * mean_edge(input.surfaces[0]);
  std::vector<Spaced> inner;
  for (std::size_t s = 1; s < input.surfaces.size(); ++s) {
    const double own = coarser * mean_edge(input.surfaces[s]);
    inner.push_back({Bvh(input.surfaces[s]), options.spacing > 0 ? std::min(own, options.spacing) : own});
  }
  return fill(bounding_box(input.nodes), outer, report.spacing, inner, options.grade,
              most_points - input.nodes.size(), progress);
}

// Delaunay tetrahedra of all points and of eight far ones about them (the last eight nodes), so that the
// surface is nowhere the hull; flipped until they hold the surface triangles.
FlipMesh tetrahedra(const Input& input, const std::vector<Vec3>& points, double spacing, PadReport& report) {
  std::vector<Vec3> nodes = points;
  const Box box = bounding_box(points);
  joggle(nodes, 1e-6 * spacing);
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 way((corner & 1) * 2 - 1, (corner & 2) - 1, (corner & 4) / 2 - 1);
    nodes.push_back(box.center() + 0.8 * (1 + 0.03 * corner) * box.diagonal() * way);
  }
  FlipMesh mesh(nodes, delaunay(nodes));
  mesh.nodes = nodes;
  const Recovery r = recover(mesh, all_triangles(input));
  report.recovered_edges = r.edges_absent - r.edges_missing;
  std::copy(points.begin(), points.end(), mesh.nodes.begin());
  return mesh;
}

// Removes what is outside, labels the rest by region.
void carve(FlipMesh& mesh, const Input& input, PadReport& report) {
  for (std::size_t s = 0; s < input.surfaces.size(); ++s) {
    const std::vector<char> in = inside(mesh, input.triangles[s], input.surfaces[s]);
    for (std::size_t i = 0; i < in.size(); ++i) {
      const auto t = static_cast<Index>(i);
      if (!mesh.alive(t)) continue;
      if (s == 0 && !in[i]) {
        const auto far = static_cast<Index>(mesh.nodes.size()) - 8;
        const Tetrahedron& x = mesh.tet(t);
        report.removed_outside += *std::max_element(x.begin(), x.end()) < far;
        mesh.kill(t);
      } else if (in[i]) {
        mesh.labels[i] = static_cast<Index>(s);
      }
    }
  }
}

// Faces of one tetrahedron, or of two with different labels.
void protect_walls(FlipMesh& mesh) {
  for (std::size_t i = 0; i < mesh.tets().size(); ++i) {
    if (!mesh.alive(static_cast<Index>(i))) continue;
    const Tetrahedron x = mesh.tets()[i];
    for (std::size_t f = 0; f < 4; ++f) {
      Triangle t{x[(f + 1) % 4], x[(f + 2) % 4], x[(f + 3) % 4]};
      if (mesh.below(t[0], t[1], t[2]) == static_cast<Index>(i)) std::swap(t[1], t[2]);
      const Index other = mesh.below(t[0], t[1], t[2]);
      if (other < 0 || mesh.labels[static_cast<std::size_t>(other)] != mesh.labels[i])
        mesh.protect_face(t[0], t[1], t[2]);
    }
  }
}

// Takes flat tetrahedra off the boundary where each of their nodes stays in use.
void peel(FlipMesh& mesh, PadReport& report) {
  for (bool again = true; again;) {
    again = false;
    for (std::size_t i = 0; i < mesh.tets().size(); ++i) {
      const auto t = static_cast<Index>(i);
      if (!mesh.alive(t) || mesh.shape_of(mesh.tet(t)) >= flat) continue;
      const Tetrahedron x = mesh.tet(t);
      bool on_boundary = false, in_use = true;
      for (std::size_t f = 0; f < 4; ++f) {
        const Index a = x[(f + 1) % 4], b = x[(f + 2) % 4], c = x[(f + 3) % 4];
        on_boundary = on_boundary || mesh.below(a, b, c) < 0 || mesh.below(a, c, b) < 0;
        in_use = in_use && mesh.around(x[f]).size() > 1;
      }
      if (!on_boundary || !in_use) continue;
      mesh.kill(t);
      ++report.slivers_removed;
      again = true;
    }
  }
}

void count_missing(const FlipMesh& mesh, const Input& input, PadReport& report) {
  for (const auto& [a, b, c] : input.triangles[0])
    if (mesh.below(a, b, c) < 0 || mesh.below(a, c, b) >= 0) {
      if (report.missing_at.size() < 10)
        report.missing_at.push_back((mesh.node(a) + mesh.node(b) + mesh.node(c)) / 3);
      ++report.missing_triangles;
    }
  for (std::size_t s = 1; s < input.triangles.size(); ++s)
    for (const auto& [a, b, c] : input.triangles[s]) report.region_missing += !mesh.has_face(a, b, c);
}

// The living tetrahedra, by ascending region and number, without interior nodes that none of them uses.
TetMesh compact(const FlipMesh& mesh, std::size_t surface_nodes) {
  std::vector<Index> number(mesh.nodes.size(), -1);
  TetMesh result;
  for (std::size_t v = 0; v < mesh.nodes.size(); ++v) {
    if (mesh.around(static_cast<Index>(v)).empty()) {
      if (v < surface_nodes)
        throw Error(ErrorKind::geometry,
                    "no tetrahedron holds vertex {} of the surface, at ({:.6g}, {:.6g}, {:.6g}): the body is "
                    "too thin "
                    "there for its triangles; refine or repair the surface",
                    v, mesh.nodes[v].x(), mesh.nodes[v].y(), mesh.nodes[v].z());
      continue;
    }
    number[v] = static_cast<Index>(result.nodes.size());
    result.nodes.push_back(mesh.nodes[v]);
  }
  for (std::size_t i = 0; i < mesh.tets().size(); ++i) {
    if (!mesh.alive(static_cast<Index>(i))) continue;
    Tetrahedron t = mesh.tets()[i];
    for (Index& v : t) v = number[static_cast<std::size_t>(v)];
    result.tets.push_back(t);
    result.regions.push_back(mesh.labels[i]);
  }
  return result;
}

}  // namespace

Padded pad(const TriangleMesh& surface, const std::vector<NamedSurface>& inner, const PadOptions& options,
           const Progress& progress) {
  return options.method == PadMethod::delaunay ? pad_delaunay(surface, inner, options, progress)
                                               : pad_stuffing(surface, inner, options, progress);
}

Padded pad_delaunay(const TriangleMesh& surface, const std::vector<NamedSurface>& inner,
                    const PadOptions& options, const Progress& progress) {
  Padded result;
  PadReport& report = result.report;
  progress.at(0);
  const Input input = gather(surface, inner, options, report);
  report.flipped = volume(surface) < 0;
  const SignedDistanceField outer(input.surfaces[0]);
  require_apart(input, outer);
  progress.at(0.1);
  std::vector<Vec3> points = input.nodes;
  const std::vector<Vec3> more = interior(input, outer, options, report, progress);
  points.insert(points.end(), more.begin(), more.end());
  progress.at(0.3);
  FlipMesh mesh = tetrahedra(input, points, report.spacing, report);
  progress.at(0.6);
  carve(mesh, input, report);
  protect_walls(mesh);
  improve(mesh, static_cast<Index>(input.nodes.size()), goal, progress);
  peel(mesh, report);
  count_missing(mesh, input, report);
  result.mesh = compact(mesh, input.surfaces[0].vertices.size());
  result.mesh.region_names = {options.name};
  for (const NamedSurface& s : inner) result.mesh.region_names.push_back(s.name);
  report.interior_points = result.mesh.nodes.size() - input.nodes.size();
  report.quality = quality(result.mesh);
  require_valid(result.mesh, "padded surface");
  progress.at(1);
  return result;
}

}  // namespace palpate
