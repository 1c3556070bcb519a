// The size of the elements, what became of the surface, and the report.
#include <algorithm>
#include <cmath>

#include "palpate/base/parallel_for.hpp"
#include "palpate/geometry/check.hpp"
#include "palpate/pad/input.hpp"
#include "palpate/pad/stuffing.hpp"

namespace palpate {

namespace {

// Surface nodes of a body-centred lattice's cut, times the cell's side squared, an area.
constexpr double nodes_per_area = 2.0;

void require_fillable(const TriangleMesh& mesh, const std::string& what, bool repair) {
  const MeshReport r = check(mesh);
  if (r.open_edges > 0 && !repair)
    throw Error(
        ErrorKind::geometry,
        "{} is open: {} edges have one triangle only; close the holes, weld vertices at the same place, "
        "or let `repair` bridge holes smaller than an element",
        what, r.open_edges);
  if (r.flipped_edges > 0)
    throw Error(ErrorKind::geometry, "{}: triangles face opposite ways across {} edges; orient them alike",
                what, r.flipped_edges);
  if (!(std::abs(r.volume) > 1e-12 * std::pow(r.box.diagonal(), 3)))
    throw Error(ErrorKind::geometry, "{} encloses no volume", what);
}

TriangleMesh prepared(TriangleMesh mesh, const std::string& what, bool repair) {
  require_numbers(mesh, what);
  drop_duplicates(mesh);
  require_fillable(mesh, what, repair);
  return mesh;
}

// Points all over a triangle, at most `spacing` apart, with their shares of its area.
template <class Visit>
void sample(const TriangleMesh& mesh, const Triangle& t, double spacing, const Visit& visit) {
  const auto at = [&](std::size_t k) -> const Vec3& { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
  const double longest = std::max({(at(0) - at(1)).norm(), (at(1) - at(2)).norm(), (at(2) - at(0)).norm()});
  const int n = static_cast<int>(std::clamp(std::ceil(longest / spacing), 1.0, 200.0));
  const double share = area_vector(mesh, t).norm() / (n * n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < 2 * (n - i) - 1; ++j) {  // triangles upright and upside down in turn
      const double u = (i + (j % 2 ? 2.0 : 1.0) / 3) / n, v = (j / 2 + (j % 2 ? 2.0 : 1.0) / 3) / n;
      visit(Vec3(at(0) + u * (at(1) - at(0)) + v * (at(2) - at(0))), share);
    }
  for (std::size_t k = 0; k < 3; ++k) visit(at(k), 0.0);
}

// How far boundary and surface are from each other.
void compare(const TriangleMesh& surface, const TriangleMesh& boundary, const SignedDistanceField& field,
             double cell, PadReport& report) {
  const auto off = [&](const Vec3& p) {
    report.boundary_off = std::max(report.boundary_off, std::abs(field.at(p).distance));
  };
  for (const Vec3& p : boundary.vertices) off(p);
  for (const Triangle& t : boundary.triangles) {
    Vec3 middle = Vec3::Zero();
    for (const Index v : t) middle += boundary.vertices[static_cast<std::size_t>(v)] / 3;
    off(middle);
  }
  const Bvh tree(boundary);
  std::vector<MissedFeature> far;
  Index hint = -1;
  for (const Triangle& t : surface.triangles) {
    MissedFeature worst;
    sample(surface, t, 0.5 * cell, [&](const Vec3& p, double share) {
      const ClosestPoint c = tree.closest(p, std::numeric_limits<double>::infinity(), hint);
      hint = c.triangle;
      const double d = std::sqrt(c.distance_squared);
      if (d > 0.5 * cell) report.missed_area += share;
      if (d > worst.distance) worst = {p, d};
    });
    if (worst.distance > 0.5 * cell) far.push_back(worst);
  }
  std::stable_sort(far.begin(), far.end(),
                   [](const MissedFeature& a, const MissedFeature& b) { return a.distance > b.distance; });
  for (const MissedFeature& f : far) {
    if (report.missed.size() == 10) break;
    if (std::all_of(report.missed.begin(), report.missed.end(),
                    [&](const MissedFeature& m) { return (m.at - f.at).norm() > 2 * cell; }))
      report.missed.push_back(f);
  }
}

}  // namespace

Padded pad_stuffing(const TriangleMesh& surface, const std::vector<NamedSurface>& inner,
                    const PadOptions& options, const Progress& progress) {
  if (!(options.spacing >= 0) || !std::isfinite(options.spacing))
    throw Error(ErrorKind::usage,
                "a spacing of {} m: give a positive one, or 0 for a number of surface nodes",
                options.spacing);
  if (options.spacing == 0 && options.surface_nodes < 20)
    throw Error(ErrorKind::usage, "{} surface nodes: ask for 20 at least", options.surface_nodes);
  require_names(options, inner);
  progress.at(0);
  const TriangleMesh used = prepared(surface, "the surface", options.repair);
  const SignedDistanceField outer(used);
  std::vector<SignedDistanceField> fields;
  for (const NamedSurface& s : inner)
    fields.emplace_back(prepared(s.surface, "inner surface \"" + s.name + "\"", options.repair));
  const MeshReport input = check(used);
  const double first =
      options.spacing > 0 ? options.spacing : std::sqrt(nodes_per_area * input.area / options.surface_nodes);
  double cell = first;
  Padded result;
  PadReport& report = result.report;
  Stuffed stuffed;
  Boundary bounding;
  // Thin parts come into sight as the cells shrink, so the number is not quite proportional.
  for (int attempt = 0; attempt < 12; ++attempt) {
    const double from = 1 - std::pow(0.5, attempt), share = 0.5 * (1 - from);
    const Progress part{[&](double f) { progress.at(0.9 * (from + share * f)); }, progress.interrupted};
    stuffed = stuff(outer, fields, input.box, cell, input.components, options.grade, part);
    bounding = boundary(stuffed.mesh);
    const double reached = static_cast<double>(bounding.nodes.size()) / options.surface_nodes;
    if (options.spacing > 0 || std::abs(reached - 1) < 0.05) break;
    const double next = cell * std::clamp(std::sqrt(reached), 0.5, 1.5);
    if (next < 0.2 * first) {
      stuffed = {};
      break;
    }
    cell = next;
  }
  if (stuffed.mesh.tets.empty()) {
    const double thickness = 2 * std::abs(input.volume) / input.area;
    throw Error(
        ErrorKind::geometry,
        "elements of {:.3g} m find too little inside of the surface: it is {:.2g} m thick on average; ask "
        "for elements of {:.2g} m, about {:.2g} surface nodes, or repair doubled walls",
        first, thickness, thickness / 2, nodes_per_area * input.area / std::pow(thickness / 2, 2));
  }
  compare(used, bounding.surface, outer, cell, report);
  result.mesh = std::move(stuffed.mesh);
  result.mesh.region_names = {options.name};
  for (const NamedSurface& s : inner) result.mesh.region_names.push_back(s.name);
  report.flipped = outer.flipped();
  report.spacing = cell;
  report.surface_nodes = bounding.nodes.size();
  report.interior_points = result.mesh.nodes.size() - bounding.nodes.size();
  report.warped = stuffed.warped, report.cut = stuffed.cut, report.kept = stuffed.kept;
  report.islands = stuffed.islands, report.islands_volume = stuffed.islands_volume;
  report.quality = quality(result.mesh);
  require_valid(result.mesh, "stuffed surface");
  progress.at(1);
  return result;
}

}  // namespace palpate
