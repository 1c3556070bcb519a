// palpate convert: what a file holds, written in another format.
#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "palpate/elasticity/calculix.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "palpate/io/container.hpp"
#include "palpate/io/surface_file.hpp"
#include "palpate/io/tet_file.hpp"
#include "palpate/io/vtu.hpp"
#include "palpate/lattice/lattice_file.hpp"
#include "palpate/simulation/handover.hpp"
#include "palpate/simulation/materials.hpp"

namespace palpate {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

bool is_one_of(const std::string& extension, std::initializer_list<const char*> list) {
  return std::any_of(list.begin(), list.end(), [&](const char* e) { return extension == e; });
}

class Conversion {
 public:
  Conversion(const ConvertOptions& o, const Console& console)
      : o_(o),
        console_(console),
        unit_(unit_in_metres(o.unit)),
        to_unit_(unit_in_metres(o.to_unit)),
        to_(o.output.extension().string()) {}

  void run() {
    const std::string from = o_.input.extension().string();
    const std::string kind = fs::is_regular_file(o_.input) ? container_kind(o_.input) : "";
    if (!kind.empty() || is_one_of(from, {".handover", ".txt", ".lattice"})) {
      if (unit_ != 1)
        throw Error(ErrorKind::usage, "{}: is in metres; --unit is for mesh files", o_.input.string());
      if (kind == "model")
        model();
      else if (from == ".handover")
        handover();
      else
        lattice();
    } else if (is_tet_file(o_.input)) {
      tets();
    } else {
      const SurfaceFile file = read_surface(o_.input, unit_);
      said("surface", file.format);
      surface(file.mesh);
    }
    console_.line(fmt::format("written   {}", o_.output.string()));
    object_["input"] = o_.input.string(), object_["output"] = o_.output.string();
    console_.object(object_);
  }

 private:
  void said(const std::string& kind, const std::string& format) {
    object_["kind"] = kind, object_["format"] = format;
    line("read", format);
  }
  void line(const std::string& label, const std::string& text) {
    console_.line(fmt::format("{:<9} {}", label, text));
  }
  [[noreturn]] void cannot(const std::string& what, const char* formats) const {
    throw Error(ErrorKind::usage, "{}: {} can be written as {}", o_.output.string(), what, formats);
  }
  // For formats that are in metres by definition.
  void require_metres() const {
    if (to_unit_ != 1)
      throw Error(ErrorKind::usage, "{}: is written in metres; --to-unit is for mesh files",
                  o_.output.string());
  }

  void surface(const TriangleMesh& mesh) {
    line("surface", fmt::format("{} triangles, {} vertices", mesh.triangles.size(), mesh.vertices.size()));
    object_["triangles"] = mesh.triangles.size(), object_["vertices"] = mesh.vertices.size();
    if (to_ == ".vtu") {
      std::vector<Vec3> points = mesh.vertices;
      for (Vec3& p : points) p /= to_unit_;
      write_vtu(o_.output, points, mesh.triangles);
    } else if (is_one_of(to_, {".obj", ".stl", ".ply"})) {
      write_surface(o_.output, mesh, to_unit_);
    } else {
      cannot("a surface", ".obj .stl .ply .vtu");
    }
  }

  void tets() {
    const TetFile file = read_tets(o_.input, unit_);
    said("tetrahedra", file.format);
    const auto note = [&](const char* key, std::size_t n, const char* what) {
      object_[key] = n;
      if (n > 0) line("note", fmt::format("{}: {}", what, n));
    };
    note("inverted", file.inverted, "inverted tetrahedra (negative volume), left as they are");
    note("higher_order", file.higher_order,
         "tetrahedra of ten nodes or more, of which the corners were taken");
    note("other_cells", file.other_cells, "cells that are no tetrahedra, left out");
    note("unused_nodes", file.unused_nodes, "nodes in no tetrahedron, left out");
    if (to_ == ".inp") return tets_to_calculix(file);
    if (to_ == ".vtu" && to_unit_ == 1 && !file.young.empty() && !file.poisson.empty())
      return materials_to_vtu(file.mesh, materials_of(file, {}));
    if (!file.young.empty()) line("note", "the materials of its cells are lost in this format");
    write_mesh(file.mesh);
  }

  void tets_to_calculix(const TetFile& file) {
    require_metres();
    const auto given = parse_region_materials(o_.materials);
    const bool known = !given.empty() || !file.young.empty();
    const std::vector<Material> materials =
        materials_of(file, known ? given : std::vector<RegionMaterial>{{"", {10e3, 0.45, 1000}}});
    if (!known) line("note", "no material is known: E = 10 kPa, nu = 0.45 (see --material)");
    std::vector<Anchor> anchors;
    for (const std::string& text : o_.anchors) anchors.push_back(parse_anchor(text, unit_));
    if (anchors.empty()) line("note", "nothing is anchored: add *BOUNDARY, or see --anchor");
    const ElementNodes nodes = element_nodes(file.mesh, o_.order);
    write_calculix(o_.output, file.mesh, nodes, materials,
                   with_middles(nodes_taken(file.mesh, anchors), nodes), {});
  }

  void write_mesh(const TetMesh& mesh) {
    line("mesh", fmt::format("{} tetrahedra, {} nodes, {} {}", mesh.tets.size(), mesh.nodes.size(),
                             mesh.region_names.size(), mesh.region_names.size() == 1 ? "region" : "regions"));
    object_["tetrahedra"] = mesh.tets.size(), object_["nodes"] = mesh.nodes.size();
    object_["regions"] = mesh.region_names;
    if (is_one_of(to_, {".obj", ".stl", ".ply"})) return surface(boundary(mesh).surface);
    if (!is_one_of(to_, {".vtu", ".msh", ".mesh", ".vtk", ".node", ".ele"}))
      cannot("a tetrahedral mesh", ".vtu .msh .mesh .vtk .node, its boundary as .obj .stl .ply");
    write_tets(o_.output, mesh, to_unit_);
  }

  void model() {
    const Organ organ = read_organ(o_.input, true, console_.progress("reading"));
    said("model", "palpate model");
    write_organ_as(organ);
  }

  void handover() {
    const Organ organ = read_handover(o_.input, console_.progress("reading"));
    said("model", "hand-over");
    if (to_ != ".h5") return write_organ_as(organ);
    require_metres();
    summary(organ);
    write_organ(o_.output, organ, "from " + o_.input.filename().string(), console_.progress("writing"));
  }

  void summary(const Organ& organ) {
    line("model",
         fmt::format("{} surface nodes, {} of them anchored, {} triangles", organ.surface_size(),
                     organ.surface_size() - organ.node_of_row.size(), organ.surface.triangles.size()));
    object_["surface_nodes"] = organ.surface_size(), object_["free_surface_nodes"] = organ.node_of_row.size();
  }

  void write_organ_as(const Organ& organ) {
    summary(organ);
    if (to_ == ".handover") {
      require_metres();
      write_handover(o_.output, organ, console_.progress("writing"));
    } else if (organ.mesh.tets.empty()) {
      surface(organ.surface);
    } else if (to_ == ".inp") {
      require_metres();
      if (!organ.beddings.empty())
        throw Error(ErrorKind::usage,
                    "{}: has a bedding, which CalculiX's decks cannot say: precompute it without",
                    o_.input.string());
      const ElementNodes nodes = element_nodes(organ.mesh, organ.order);
      write_calculix(o_.output, organ.mesh, nodes, organ.materials,
                     with_middles(nodes_taken(organ.mesh, organ.anchors), nodes), {});
    } else if (to_ == ".vtu" && to_unit_ == 1) {
      vtu_of(organ);
    } else if (is_one_of(to_, {".vtu", ".msh", ".mesh", ".vtk", ".node", ".ele", ".obj", ".stl", ".ply"})) {
      write_mesh(organ.mesh);
    } else {
      cannot("a model", ".vtu .msh .mesh .vtk .node .obj .stl .ply, as .inp (CalculiX) and as .handover");
    }
  }

  // What was computed from: regions, materials, anchors.
  void vtu_of(const Organ& organ) {
    VtuField anchored{"anchored", 1, {}}, bedded{"bedded", 1, {}};
    for (const std::uint8_t a : nodes_taken(organ.mesh, organ.anchors)) anchored.values.push_back(a);
    for (const std::uint8_t b : bedded_nodes(organ.mesh, organ.beddings)) bedded.values.push_back(b);
    materials_to_vtu(organ.mesh, organ.materials, {anchored, bedded});
  }

  void materials_to_vtu(const TetMesh& mesh, const std::vector<Material>& materials,
                        const std::vector<VtuField>& of_nodes = {}) {
    VtuField young{"young_Pa", 1, {}}, poisson{"poisson", 1, {}}, density{"density_kg_m3", 1, {}};
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
      const Material& m = material_of(mesh, materials, t);
      young.values.push_back(static_cast<float>(m.young));
      poisson.values.push_back(static_cast<float>(m.poisson));
      density.values.push_back(static_cast<float>(m.density));
    }
    write_vtu(o_.output, mesh, of_nodes, {young, poisson, density});
  }

  void lattice() {
    const LatticeFile file = read_lattice(o_.input);
    said("lattice", file.surface.triangles.empty() ? "text" : "palpate lattice");
    const Grid& g = file.samples.grid;
    line("grid", fmt::format("{} x {} x {} points, h = {:.6g} m", g.n[0], g.n[1], g.n[2], g.h));
    object_["n"] = g.n, object_["spacing_m"] = g.h;
    if (is_one_of(to_, {".obj", ".stl", ".ply"}) && !file.surface.triangles.empty())
      return surface(file.surface);
    require_metres();
    if (is_one_of(to_, {".txt", ".lattice"}))
      write_lattice_text(o_.output, file.samples);
    else if (to_ == ".vti")
      write_lattice_vti(o_.output, file.samples);
    else if (to_ == ".h5" || to_ == ".hdf5")
      write_lattice(o_.output, file.samples, file.surface, "from " + o_.input.filename().string());
    else
      cannot("a lattice", ".h5, .txt (the thesis' text), .vti, its surface as .obj .stl .ply");
  }

  const ConvertOptions& o_;
  const Console& console_;
  double unit_, to_unit_;
  std::string to_;
  json object_ = json::object();
};

}  // namespace

void run_convert(const ConvertOptions& options, const Console& console) {
  Conversion(options, console).run();
}

}  // namespace palpate
