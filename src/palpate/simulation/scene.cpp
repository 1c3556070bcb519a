#include "palpate/simulation/scene.hpp"

#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <cmath>
#include <sstream>

#include "palpate/elasticity/tissues.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/io/surface_file.hpp"
#include "palpate/io/tet_file.hpp"
#include "palpate/lattice/lattice_file.hpp"
#include "palpate/pad/pad.hpp"
#include "palpate/simulation/materials.hpp"

namespace palpate {

namespace {

struct Unit {
  const char* name;
  double factor;
};
const std::vector<Unit> length_units{{"m", 1}, {"cm", 1e-2}, {"mm", 1e-3}, {"um", 1e-6}, {"in", 0.0254}};
const std::vector<Unit> pressure_units{{"Pa", 1}, {"kPa", 1e3}, {"MPa", 1e6}, {"GPa", 1e9}};
const std::vector<Unit> time_units{{"s", 1}, {"ms", 1e-3}, {"us", 1e-6}};
const std::vector<Unit> force_units{{"N", 1}, {"mN", 1e-3}};
const std::vector<Unit> density_units{{"kg/m3", 1}, {"g/cm3", 1e3}};
const std::vector<Unit> no_units{{"", 1}};

// One table of the file; remembers which keys were asked for, so that a misspelt one is found.
class Table {
 public:
  Table(const toml::table& table, std::filesystem::path file, std::string name)
      : table_(table), file_(std::move(file)), name_(std::move(name)) {}

  [[noreturn]] void fail(const std::string& key, const std::string& what) const {
    const toml::node* node = table_.get(key);
    const auto line = (node ? node->source() : table_.source()).begin.line;
    throw Error(ErrorKind::format, "{}:{}: {}: {}", file_.string(), line,
                key.empty()     ? name_
                : name_.empty() ? key
                                : name_ + "." + key,
                what);
  }
  bool has(const std::string& key) {
    known_.push_back(key);
    return table_.contains(key);
  }
  std::string text(const std::string& key, const std::string& otherwise) {
    if (!has(key)) return otherwise;
    if (const auto value = table_.get(key)->value_exact<std::string>()) return *value;
    fail(key, "must be a text in quotes");
  }
  bool flag(const std::string& key, bool otherwise) {
    if (!has(key)) return otherwise;
    if (const auto value = table_.get(key)->value_exact<bool>()) return *value;
    fail(key, "must be true or false");
  }
  // A number in SI units, or a text with a unit: "12 mm".
  double quantity(const std::string& key, double otherwise, const std::vector<Unit>& units) {
    return has(key) ? to_number(key, *table_.get(key), units) : otherwise;
  }
  std::int64_t whole(const std::string& key, std::int64_t otherwise, std::int64_t least, std::int64_t most) {
    if (!has(key)) return otherwise;
    const auto value = table_.get(key)->value_exact<std::int64_t>();
    if (!value || *value < least || *value > most)
      fail(key, fmt::format("must be a whole number from {} to {}", least, most));
    return *value;
  }
  std::vector<double> quantities(const std::string& key, std::size_t count, const std::vector<Unit>& units) {
    std::vector<double> out;
    const toml::array* array = has(key) ? table_.get(key)->as_array() : nullptr;
    if (!array || array->size() != count) fail(key, fmt::format("must be a list of {} numbers", count));
    for (const toml::node& node : *array) out.push_back(to_number(key, node, units));
    return out;
  }
  std::vector<std::string> texts(const std::string& key) {
    std::vector<std::string> out;
    if (!has(key)) return out;
    const toml::array* array = table_.get(key)->as_array();
    if (!array) fail(key, "must be a list of texts");
    for (const toml::node& node : *array) {
      const auto value = node.value_exact<std::string>();
      if (!value) fail(key, "must be a list of texts");
      out.push_back(*value);
    }
    return out;
  }
  // Tables under a list of tables, or of a table of tables with their names.
  std::vector<std::pair<std::string, Table>> children(const std::string& key) {
    std::vector<std::pair<std::string, Table>> out;
    if (!has(key)) return out;
    const toml::node& node = *table_.get(key);
    const auto add = [&](const std::string& child, const toml::node& n) {
      if (!n.is_table()) fail(key, "must hold tables");
      out.emplace_back(child, Table(*n.as_table(), file_, name_.empty() ? key : name_ + "." + key));
    };
    if (const toml::array* array = node.as_array())
      for (const toml::node& n : *array) add("", n);
    else if (const toml::table* table = node.as_table())
      for (const auto& [k, n] : *table) add(std::string(k.str()), n);
    else
      fail(key, "must be a table or a list of tables");
    return out;
  }
  Table child(const std::string& key) {
    if (!has(key) || !table_.get(key)->is_table()) fail(key, "this table is missing");
    return Table(*table_.get(key)->as_table(), file_, name_.empty() ? key : name_ + "." + key);
  }
  // A table, or each of a list of them.
  std::vector<Table> one_or_more(const std::string& key) {
    const toml::array* array = has(key) ? table_.get(key)->as_array() : nullptr;
    if (!array) return {child(key)};
    std::vector<Table> out;
    for (auto& [name, table] : children(key)) out.push_back(table);
    if (out.empty()) fail(key, "this list is empty");
    return out;
  }
  bool is_list(const std::string& key) const { return table_.get(key) && table_.get(key)->is_array(); }
  std::filesystem::path path(const std::string& key) { return file_.parent_path() / text(key, ""); }
  void no_other_keys() const {
    for (const auto& [key, node] : table_)
      if (std::find(known_.begin(), known_.end(), key.str()) == known_.end())
        fail(std::string(key.str()), fmt::format("unknown; here one may say {}", fmt::join(known_, ", ")));
  }

 private:
  double to_number(const std::string& key, const toml::node& node, const std::vector<Unit>& units) const {
    double value = std::nan("");
    if (node.is_number()) {
      value = *node.value<double>();
    } else if (const auto text = node.value_exact<std::string>()) {
      std::istringstream in(*text);
      std::string unit;
      in >> value >> unit;
      if (in.fail()) value = std::nan("");
      bool found = false;
      for (const Unit& u : units)
        if (unit == u.name && !found) value *= u.factor, found = true;
      if (!found) value = std::nan("");
    }
    if (!std::isfinite(value)) {
      std::vector<std::string> names;
      for (const Unit& u : units) names.emplace_back(u.name);
      fail(key, fmt::format("must be a number{}",
                            units.size() > 1 ? fmt::format(" in {}, or a text with one of {}: \"12 {}\"",
                                                           names[0], fmt::join(names, ", "), names.back())
                                             : std::string()));
    }
    return value;
  }

  const toml::table& table_;
  std::filesystem::path file_;
  std::string name_;
  std::vector<std::string> known_;
};

// Materials of the regions, in their order; or of the tetrahedra, where the file has them.
std::vector<Material> read_materials(Table& organ, const TetFile& file) {
  std::vector<RegionMaterial> given;
  for (auto& [region, table] : organ.children("materials")) {
    const std::vector<std::string>& regions = file.mesh.region_names;
    if (std::find(regions.begin(), regions.end(), region) == regions.end())
      table.fail("", fmt::format("there is no region '{}'; there are {}", region, fmt::join(regions, ", ")));
    Material m;
    if (table.has("tissue")) m = parse_material(table.text("tissue", ""), region);
    m.young = table.quantity("young", m.young, pressure_units);
    m.poisson = table.quantity("poisson", m.poisson, no_units);
    m.density = table.quantity("density", m.density, density_units);
    table.no_other_keys();
    require_valid(m, region);
    given.push_back({region, m});
  }
  try {
    return materials_of(file, given);
  } catch (const Error& e) {
    organ.fail("materials", fmt::format("{} (materials.{} = {{ young = \"10 kPa\", poisson = 0.45 }}, or {{ "
                                        "tissue = \"liver\" }})",
                                        e.what(), file.mesh.region_names.at(0)));
  }
}

// listed: of [[organ]], whose name is the body's; of [organ] it is the tissue's.
TetFile read_or_pad(Table& organ, double unit, bool listed, const Progress& progress) {
  if (organ.has("tets")) return read_tets(organ.path("tets"), unit);
  TetFile out;
  if (organ.has("kidney")) {
    const auto nodes = static_cast<int>(organ.whole("kidney", 0, 50, 100000));
    out.mesh = pad_delaunay(make_kidney(nodes), {{"stone", make_stone(150)}}, {}, progress).mesh;
    return out;
  }
  std::vector<NamedSurface> inner;
  for (auto& [name, table] : organ.children("regions")) {
    inner.push_back(
        {name.empty() ? table.text("name", "inner") : name, read_surface(table.path("surface"), unit).mesh});
    table.no_other_keys();
  }
  PadOptions options;
  if (!listed) options.name = organ.text("name", options.name);
  const std::string method = organ.text("method", "stuffing");
  if (method != "stuffing" && method != "delaunay") organ.fail("method", "must be stuffing or delaunay");
  options.method = method == "stuffing" ? PadMethod::stuffing : PadMethod::delaunay;
  options.surface_nodes = static_cast<int>(organ.whole("surface_nodes", 3000, 20, 1000000));
  options.spacing = organ.quantity("spacing", 0, length_units);
  options.repair = organ.flag("repair", false);
  if (!organ.has("surface"))
    organ.fail("", "say model = \"x.h5\", tets = \"x.vtu\", surface = \"x.stl\" or kidney = 1000");
  out.mesh = pad(read_surface(organ.path("surface"), unit).mesh, inner, options, progress).mesh;
  return out;
}

Organ read_organ_table(Table organ, bool listed, int threads, const Progress& progress) {
  Organ out;
  if (organ.has("model")) {
    out = read_organ(organ.path("model"), true, progress);
  } else {
    const double unit = unit_in_metres(organ.text("unit", "m"));
    TetFile file = read_or_pad(organ, unit, listed, progress);
    std::vector<Material> materials = read_materials(organ, file);
    std::vector<Anchor> anchors;
    for (const std::string& text : organ.texts("anchors")) anchors.push_back(parse_anchor(text, unit));
    BakeOptions options;
    options.order = static_cast<int>(organ.whole("order", 2, 1, 2));
    for (const std::string& text : organ.texts("beddings"))
      options.beddings.push_back(parse_bedding(text, unit));
    if (organ.has("drawing")) options.drawing = read_surface(organ.path("drawing"), unit).mesh;
    out = bake(std::move(file.mesh), std::move(materials), std::move(anchors), threads, progress, nullptr,
               options);
  }
  organ.no_other_keys();
  return out;
}

// A lattice from a surface, about its own bounding box with a margin of two cells, so that contact is seen
// before it happens.
Instrument lattice_instrument(Table& t, int threads, const Progress& progress) {
  Instrument out;
  const double unit = unit_in_metres(t.text("unit", "m")) * t.quantity("scale", 1, no_units);
  if (!(unit > 0)) t.fail("scale", "must be above zero");
  out.surface = read_surface(t.path("surface"), unit).mesh;
  const auto subdivisions = static_cast<int>(t.whole("subdivisions", 40, 1, 1000));
  const Box box = bounding_box(out.surface.vertices);
  const double h = t.quantity("spacing", box.size().minCoeff() / subdivisions, length_units);
  if (!(h > 0)) t.fail("spacing", "must be above zero");
  const Grid grid = make_grid_spaced(box, h, 2 * h);
  if (static_cast<double>(grid.n[0]) * grid.n[1] * grid.n[2] > 2e8)
    t.fail("spacing", "the lattice would have more than 200 million points");
  out.shape = std::make_shared<const Lattice>(
      sample_lattice(SignedDistanceField(out.surface), grid, threads, progress));
  return out;
}

Instrument read_instrument(Table t, std::size_t number, int threads, const Progress& progress) {
  Instrument out;
  if (t.has("surface")) {
    out = lattice_instrument(t, threads, progress);
  } else if (t.has("lattice")) {
    const std::filesystem::path path = t.path("lattice");
    if (is_band_file(path)) {
      BandFile file = read_band(path);
      out.shape = std::make_shared<const BandLattice>(file.samples);
      out.surface = std::move(file.surface);
    } else {
      LatticeFile file = read_lattice(path);
      out.shape = std::make_shared<const Lattice>(file.samples);
      out.surface = std::move(file.surface);
    }
  } else if (t.has("sphere")) {
    out.shape = Sphere{t.quantity("sphere", 0, length_units)};
  } else if (t.has("capsule")) {
    const auto v = t.quantities("capsule", 2, length_units);
    out.shape = Capsule{v[0], v[1]};
  } else if (t.has("cuboid")) {
    const auto v = t.quantities("cuboid", 3, length_units);
    out.shape = Cuboid{Vec3(v[0], v[1], v[2])};
  } else if (t.has("half_space")) {
    out.shape = HalfSpace{};
  } else {
    t.fail("",
           "say surface, lattice, sphere (radius), capsule [radius, half length], cuboid [half sides] or "
           "half_space = true");
  }
  if (!has_size(out.shape)) t.fail("", "its sizes must be above zero");
  if (out.surface.triangles.empty()) out.surface = surface_of_primitive(out.shape);
  const Box box = bounding_box(out.shape);
  if (!(box.size().minCoeff() > 0)) t.fail("", "its sizes must be above zero");
  out.tip = t.quantity("tip", 0, length_units);
  if (!(out.tip >= 0) || !std::isfinite(out.tip)) t.fail("tip", "must be a thickness above zero");
  out.name = t.text("name", fmt::format("instrument{}", number));
  t.no_other_keys();
  return out;
}

// Names of the organs in the motion: "organ" for the one of an [organ]; of a list [[organ]] each its own.
std::vector<std::string> name_organs(std::vector<Table>& organs, bool listed) {
  std::vector<std::string> names;
  for (Table& t : organs) {
    const std::string name =
        listed ? t.text("name", fmt::format("organ{}", names.size() + 1)) : std::string("organ");
    if (std::find(names.begin(), names.end(), name) != names.end())
      t.fail("name", fmt::format("'{}' is taken", name));
    names.push_back(name);
  }
  return names;
}

// Bodies a thousand times larger or smaller than each other are a unit gone wrong.
void require_comparable(const Table& root, const Model& model) {
  const double organ = bounding_box(model.organ.surface.vertices).diagonal();
  for (const Instrument& i : model.instruments) {
    const double size = bounding_box(i.shape).diagonal();
    if (std::isfinite(size) && (size > 1e3 * organ || organ > 1e3 * size))
      root.fail("instrument", fmt::format("'{}' measures {:.3g} m, the organ {:.3g} m; check unit and scale",
                                          i.name, size, organ));
  }
}

Settings read_settings(Table t) {
  Settings s;
  s.mode = parse_mode(t.text("mode", name(s.mode)));
  s.tolerance = t.quantity("tolerance", s.tolerance, no_units);
  if (!(s.tolerance > 0 && s.tolerance < 0.1))
    t.fail("tolerance", "must lie between 0 and 0.1 (of the organ's size)");
  s.max_contacts = static_cast<int>(t.whole("max_contacts", s.max_contacts, 1, 5000));
  s.max_relinearisations =
      static_cast<int>(t.whole("max_relinearisations", s.max_relinearisations, 1, 10000));
  s.friction = t.quantity("friction", s.friction, no_units);
  if (!(s.friction >= 0 && s.friction <= 10)) t.fail("friction", "must lie between 0 and 10");
  s.gaussian_force = t.quantity("gaussian_force", s.gaussian_force, force_units);
  s.gaussian_radius = t.quantity("gaussian_radius", s.gaussian_radius, length_units);
  if (!(s.gaussian_radius > 0)) t.fail("gaussian_radius", "must be above zero");
  t.no_other_keys();
  return s;
}

toml::table parse(const std::filesystem::path& path) {
  try {
    return toml::parse(read_file(path), path.string());
  } catch (const toml::parse_error& error) {
    throw Error(ErrorKind::format, "{}:{}: {}", path.string(), error.source().begin.line,
                std::string(error.description()));
  }
}

}  // namespace

Scene read_scene(const std::filesystem::path& path, int threads, const Progress& progress) {
  const toml::table file = parse(path);
  Table root(file, path, "");
  Scene scene;
  Model model;  // without its organ
  if (root.has("settings")) model.settings = read_settings(root.child("settings"));
  Table motion = root.child("motion");
  scene.dt = motion.quantity("dt", 0.001, time_units);
  if (!(scene.dt > 0)) motion.fail("dt", "must be above zero");
  scene.steps = static_cast<std::size_t>(motion.whole("steps", 0, 0, 1'000'000'000));

  std::vector<Table> organs = root.one_or_more("organ");
  const bool listed = root.is_list("organ");
  scene.organs = name_organs(organs, listed);
  if (organs.size() > 1 && model.settings.mode == Mode::gaussian)
    root.fail("settings", "mode gaussian spreads a force over one organ; use another mode, or one [organ]");
  std::vector<std::string> names, taken = scene.organs;
  for (auto& [key, table] : root.children("instrument")) {
    model.instruments.push_back(read_instrument(table, names.size() + 1, threads, progress));
    const std::string& name = model.instruments.back().name;
    if (std::find(taken.begin(), taken.end(), name) != taken.end())
      table.fail("name", fmt::format("'{}' is taken", name));
    names.push_back(name), taken.push_back(name);
  }
  if (names.empty()) root.fail("", "no [[instrument]]");
  const double unit = unit_in_metres(motion.text("unit", "m"));
  scene.motion = read_motion(motion.path("file"), names, unit, scene.organs);
  motion.no_other_keys();
  if (scene.steps == 0)
    scene.steps =
        static_cast<std::size_t>(std::floor(
            (scene.motion.motion.times.back() - scene.motion.motion.times.front()) / scene.dt + 1e-6)) +
        1;
  scene.models.reserve(organs.size());
  for (const Table& organ : organs) {
    scene.models.push_back(model);
    scene.models.back().organ = read_organ_table(organ, listed, threads, progress);
    require_comparable(root, scene.models.back());
  }
  root.no_other_keys();
  return scene;
}

}  // namespace palpate
