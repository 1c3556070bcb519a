// Models as HDF5 (container.hpp, kind "model"): mesh, materials and anchors, and the compliance in its
// storage.
#include <fmt/ranges.h>

#include <algorithm>

#include "palpate/compliance/compliance_file.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "palpate/io/container.hpp"
#include "palpate/simulation/organ.hpp"

namespace palpate {

namespace {

constexpr int model_version = 2;  // 1 had no order: linear

std::vector<double> flat(std::span<const Vec3> points) {
  std::vector<double> out;
  out.reserve(3 * points.size());
  for (const Vec3& p : points) out.insert(out.end(), {p.x(), p.y(), p.z()});
  return out;
}

template <std::size_t N>
std::vector<Index> flat(const std::vector<std::array<Index, N>>& cells) {
  std::vector<Index> out;
  out.reserve(N * cells.size());
  for (const auto& c : cells) out.insert(out.end(), c.begin(), c.end());
  return out;
}

std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> out;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    out.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return out;
}

class ModelReader {
 public:
  ModelReader(const std::filesystem::path& path, bool verify, const Progress& progress)
      : path_(path), in_(path, "model", model_version), verify_(verify), progress_(progress) {}

  Organ read() {
    Organ organ;
    organ.mesh.nodes = points("mesh/nodes");
    organ.mesh.tets = cells<4>("mesh/tets", organ.mesh.nodes.size());
    organ.mesh.regions = in_.vector<Index>("mesh/regions");
    organ.mesh.region_names = lines(in_.text("region_names"));
    const std::vector<double> m = in_.vector<double>("materials");
    require(m.size() == 3 * organ.mesh.region_names.size() || m.size() == 3 * organ.mesh.tets.size(),
            "materials do not match the regions");
    for (std::size_t i = 0; i < m.size(); i += 3) organ.materials.push_back({m[i], m[i + 1], m[i + 2]});
    for (const std::string& line : lines(in_.text("anchors"))) organ.anchors.push_back(parse_anchor(line));
    if (in_.has_attribute("beddings"))
      for (const std::string& line : lines(in_.text("beddings")))
        organ.beddings.push_back(parse_bedding(line));
    organ.surface.vertices = points("surface/vertices");
    organ.surface.triangles = cells<3>("surface/triangles", organ.surface.vertices.size());
    organ.surface_nodes = in_.vector<Index>("surface/nodes");
    organ.row_of = in_.vector<Index>("surface/rows");
    organ.order = in_.version() < 2 ? 1 : static_cast<int>(in_.integer("order"));
    require(organ.order == 1 || organ.order == 2, "the tetrahedra are neither linear nor quadratic");
    organ.hash = static_cast<std::uint64_t>(in_.integer("hash"));
    check(organ);
    set_readings(organ);
    organ.discretisation = read_discretisation(in_);
    if (in_.has("drawing/vertices")) {
      TriangleMesh drawing;
      drawing.vertices = points("drawing/vertices");
      drawing.triangles = cells<3>("drawing/triangles", drawing.vertices.size());
      organ.drawing = embed(std::move(drawing), organ.surface);
      organ.drawing.error_rms = in_.number("drawing_error_rms");
      organ.drawing.error_max = in_.number("drawing_error_max");
    }
    organ.compliance = read_compliance(in_, path_.string(), organ.node_of_row.size(), verify_, progress_);
    return organ;
  }

 private:
  void require(bool ok, const char* what) const {
    if (!ok)
      throw Error(ErrorKind::format, "{}: {}; the file is damaged: precompute it again", path_.string(),
                  what);
  }

  std::vector<Vec3> points(const std::string& name) const {
    const std::vector<double> values = in_.vector<double>(name);
    require(values.size() % 3 == 0, "points have no three coordinates");
    std::vector<Vec3> out;
    out.reserve(values.size() / 3);
    for (std::size_t i = 0; i < values.size(); i += 3)
      out.emplace_back(values[i], values[i + 1], values[i + 2]);
    for (const Vec3& p : out) require(p.allFinite(), "a coordinate is no number");
    return out;
  }

  template <std::size_t N>
  std::vector<std::array<Index, N>> cells(const std::string& name, std::size_t nodes) const {
    const std::vector<Index> values = in_.vector<Index>(name);
    require(values.size() % N == 0, "cells are cut short");
    std::vector<std::array<Index, N>> out(values.size() / N);
    for (std::size_t i = 0; i < values.size(); ++i) {
      require(values[i] >= 0 && static_cast<std::size_t>(values[i]) < nodes,
              "a cell names a node that is not there");
      out[i / N][i % N] = values[i];
    }
    return out;
  }

  void check(Organ& organ) const {
    const std::size_t s = organ.surface_size();
    require(organ.row_of.size() == s && (organ.surface_nodes.size() == s || organ.mesh.nodes.empty()),
            "surface arrays differ in length");
    for (const Index n : organ.surface_nodes)
      require(n >= 0 && static_cast<std::size_t>(n) < organ.mesh.nodes.size(),
              "a surface node is not in the mesh");
    for (std::size_t i = 0; i < s; ++i)
      if (organ.row_of[i] >= 0) {
        require(organ.row_of[i] == static_cast<Index>(organ.node_of_row.size()),
                "rows are not numbered in order");
        organ.node_of_row.push_back(static_cast<Index>(i));
      }
    require(!organ.node_of_row.empty(), "no surface node can move");
    if (!organ.mesh.tets.empty()) {
      require_valid(organ.mesh, path_.string());
      require(organ.hash == organ_hash(organ),
              "mesh, materials, anchors or beddings are not those the compliance was computed from");
    }
  }

  std::filesystem::path path_;
  ContainerReader in_;
  bool verify_;
  const Progress& progress_;
};

}  // namespace

Discretisation read_discretisation(const ContainerReader& in) {
  Discretisation d;
  if (!in.has_attribute("pinch_against_order")) return d;
  d.against = static_cast<int>(in.integer("pinch_against_order"));
  d.stiffness = in.number("pinch_too_stiff");
  d.displacement = in.number("pinch_displacement_error");
  for (int a = 0; a < 3; ++a) d.at[a] = in.number(fmt::format("pinch_at_{}", "xyz"[a]));
  d.radius = in.number("pinch_radius");
  return d;
}

void write_organ(const std::filesystem::path& path, const Organ& organ, const std::string& provenance,
                 const Progress& progress) {
  ContainerWriter out(path, "model", model_version);
  out.attribute("provenance", provenance);
  out.attribute("hash", static_cast<std::int64_t>(organ.hash));
  out.attribute("order", static_cast<std::int64_t>(organ.order));
  out.attribute("region_names", fmt::format("{}", fmt::join(organ.mesh.region_names, "\n")));
  std::vector<std::string> anchors;
  for (const Anchor& a : organ.anchors) anchors.push_back(to_string(a));
  out.attribute("anchors", fmt::format("{}", fmt::join(anchors, "\n")));
  if (!organ.beddings.empty()) {
    std::vector<std::string> beddings;
    for (const Bedding& b : organ.beddings) beddings.push_back(to_string(b));
    out.attribute("beddings", fmt::format("{}", fmt::join(beddings, "\n")));
  }

  if (const Discretisation& d = organ.discretisation; d.against != 0) {
    out.attribute("pinch_against_order", static_cast<std::int64_t>(d.against));
    out.attribute("pinch_too_stiff", d.stiffness);
    out.attribute("pinch_displacement_error", d.displacement);
    for (int a = 0; a < 3; ++a) out.attribute(fmt::format("pinch_at_{}", "xyz"[a]), d.at[a]);
    out.attribute("pinch_radius", d.radius);
  }

  std::vector<double> materials;
  for (const Material& m : organ.materials)
    materials.insert(materials.end(), {m.young, m.poisson, m.density});
  const auto put = [&](const std::string& name, const auto& values, std::size_t width, const char* unit,
                       const char* meaning) {
    using T = typename std::decay_t<decltype(values)>::value_type;
    std::vector<std::size_t> shape{values.size() / width};
    if (width > 1) shape.push_back(width);
    out.array<T>(name, std::span<const T>(values), shape, unit, meaning);
  };
  put("mesh/nodes", flat(organ.mesh.nodes), 3, "m", "nodes at rest");
  put("mesh/tets", flat(organ.mesh.tets), 4, "", "nodes of each tetrahedron");
  put("mesh/regions", organ.mesh.regions, 1, "", "region of each tetrahedron, an index into region_names");
  put("materials", materials, 3, "Pa, 1, kg/m3",
      "Young's modulus, Poisson's ratio, density of each region or each tetrahedron");
  put("surface/vertices", flat(organ.surface.vertices), 3, "m", "surface nodes at rest");
  put("surface/triangles", flat(organ.surface.triangles), 3, "",
      "surface nodes of each triangle, counter-clockwise from outside");
  put("surface/nodes", organ.surface_nodes, 1, "", "mesh node of each surface node");
  put("surface/rows", organ.row_of, 1, "", "row of each surface node in the compliance, -1: anchored");
  if (!organ.drawing.empty()) {
    put("drawing/vertices", flat(organ.drawing.surface.vertices), 3, "m", "vertices of the drawing at rest");
    put("drawing/triangles", flat(organ.drawing.surface.triangles), 3, "", "vertices of each triangle");
    out.attribute("drawing_error_rms", organ.drawing.error_rms);
    out.attribute("drawing_error_max", organ.drawing.error_max);
  }

  write_compliance(out, organ.compliance, progress);
  out.commit();
}

Organ read_organ(const std::filesystem::path& path, bool verify, const Progress& progress) {
  return ModelReader(path, verify, progress).read();
}

}  // namespace palpate
