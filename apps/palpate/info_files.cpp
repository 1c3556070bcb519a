// The files of our own, from their attributes and the shapes of their arrays; with --verify all is read.
#include <fmt/core.h>

#include <algorithm>
#include <limits>

#include "console.hpp"
#include "info.hpp"
#include "palpate/io/container.hpp"
#include "palpate/lattice/band_lattice.hpp"
#include "palpate/lattice/lattice_file.hpp"
#include "palpate/simulation/recording.hpp"

namespace palpate {

namespace {

constexpr int any_version = std::numeric_limits<int>::max();

std::size_t rows(const ContainerReader& in, const std::string& name) {
  const std::vector<std::size_t> shape = in.shape(name);
  return shape.empty() ? 0 : shape[0];
}

// What whole lattices and bands say of the surface they were made of.
void add_origin_of(const ContainerReader& in, Facts& facts) {
  facts.add("sign", in.text("sign"));
  facts.add("surface", fmt::format("{} on {}", count(rows(in, "surface/triangles"), "triangle", "triangles"),
                                   count(rows(in, "surface/vertices"), "vertex", "vertices")));
  facts.add("made of", in.text("provenance"));
  facts.object["sign"] = in.text("sign"), facts.object["provenance"] = in.text("provenance");
  facts.object["triangles"] = rows(in, "surface/triangles"), facts.object["version"] = in.version();
}

void info_lattice(const InfoOptions& options, Facts& facts) {
  const ContainerReader in(options.input, "lattice", any_version);
  const std::vector<std::size_t> n = in.shape("distance");
  if (n.size() != 3) throw Error(ErrorKind::format, "{}: its distances are no grid", options.input.string());
  const double h = in.number("spacing");
  const Vec3 origin(in.number("origin_x"), in.number("origin_y"), in.number("origin_z"));
  const Vec3 cells(static_cast<double>(n[0]) - 1, static_cast<double>(n[1]) - 1,
                   static_cast<double>(n[2]) - 1);
  facts.add("lattice", fmt::format("{} x {} x {} points, {:.5g} mm apart", n[0], n[1], n[2], 1e3 * h));
  facts.object["points"] = n, facts.object["spacing_m"] = h;
  facts.add_box({origin, origin + h * cells}, "");
  add_origin_of(in, facts);
  if (!options.verify) return;
  const LatticeFile file = read_lattice(options.input);
  const auto& d = file.samples.distance;
  const auto [least, most] = std::minmax_element(d.begin(), d.end());
  facts.add("distances", fmt::format("{:.5g} to {:.5g} mm", 1e3 * *least, 1e3 * *most));
  facts.object["distance_m"] = {*least, *most};
}

void info_band(const InfoOptions& options, Facts& facts) {
  const ContainerReader in(options.input, "band lattice", any_version);
  const std::array<std::int64_t, 3> n{in.integer("points_x"), in.integer("points_y"), in.integer("points_z")};
  const double h = in.number("spacing"), band = in.number("band");
  const Vec3 origin(in.number("origin_x"), in.number("origin_y"), in.number("origin_z"));
  facts.add("band", fmt::format("{:.5g} mm of a lattice of {} x {} x {} points, {:.5g} mm apart", 1e3 * band,
                                n[0], n[1], n[2], 1e3 * h));
  facts.add("bricks", fmt::format("{} of 8 x 8 x 8 points", rows(in, "distance")));
  facts.object.update({{"points", n}, {"spacing_m", h}, {"band_m", band}, {"bricks", rows(in, "distance")}});
  facts.add_box({origin, origin + h * Vec3(double(n[0]) - 1, double(n[1]) - 1, double(n[2]) - 1)}, "");
  add_origin_of(in, facts);
  if (options.verify) read_band(options.input);
}

// The thesis' text.
void info_text_lattice(const InfoOptions& options, Facts& facts) {
  const LatticeSamples samples = read_lattice(options.input).samples;
  const Grid& grid = samples.grid;
  const auto [least, most] = std::minmax_element(samples.distance.begin(), samples.distance.end());
  facts.add("lattice", fmt::format("{} x {} x {} points, {:.5g} mm apart, text", grid.n[0], grid.n[1],
                                   grid.n[2], 1e3 * grid.h));
  facts.add_box(grid.box(), "");
  facts.add("distances", fmt::format("{:.5g} to {:.5g} mm", 1e3 * *least, 1e3 * *most));
  facts.object.update({{"points", grid.n}, {"spacing_m", grid.h}, {"distance_m", {*least, *most}}});
}

void add_materials(const ContainerReader& in, Facts& facts) {
  const std::vector<double> m = in.vector<double>("materials");
  const std::string names = in.text("region_names");
  const auto regions = static_cast<std::size_t>(std::count(names.begin(), names.end(), '\n')) + 1;
  if (m.size() != 3 * regions) {
    std::array<double, 6> range{};  // lowest and highest of each
    for (std::size_t i = 0; i < m.size(); ++i) {
      double &low = range[2 * (i % 3)], &high = range[2 * (i % 3) + 1];
      low = i < 3 ? m[i] : std::min(low, m[i]), high = i < 3 ? m[i] : std::max(high, m[i]);
    }
    facts.add("materials",
              fmt::format("of each tetrahedron: E {:.6g} to {:.6g} Pa, nu {:.4g} to {:.4g}, {:.5g} to "
                          "{:.5g} kg/m3",
                          range[0], range[1], range[2], range[3], range[4], range[5]));
    facts.object["materials"] = {{"young_pa", {range[0], range[1]}},
                                 {"poisson", {range[2], range[3]}},
                                 {"density_kg_m3", {range[4], range[5]}}};
    return;
  }
  std::size_t at = 0;
  for (std::size_t r = 0; r < regions; ++r) {
    const std::size_t end = std::min(names.find('\n', at), names.size());
    const std::string name = names.substr(at, end - at);
    at = std::min(end + 1, names.size());
    facts.add(r == 0 ? "materials" : "", fmt::format("{}: E {:.6g} Pa, nu {:.4g}, {:.5g} kg/m3", name,
                                                     m[3 * r], m[3 * r + 1], m[3 * r + 2]));
    facts.object["materials"].push_back({{"region", name},
                                         {"young_pa", m[3 * r]},
                                         {"poisson", m[3 * r + 1]},
                                         {"density_kg_m3", m[3 * r + 2]}});
  }
}

// A list, a line each, on one line.
void add_list(const ContainerReader& in, const char* name, Facts& facts) {
  if (!in.has_attribute(name)) return;
  std::string text = in.text(name);
  facts.object[name] = text;
  std::replace(text.begin(), text.end(), '\n', ';');
  if (!text.empty()) facts.add(name, text.size() > 100 ? text.substr(0, 100) + "..." : text);
}

void info_model(const InfoOptions& options, Facts& facts, const Console& console) {
  const ContainerReader in(options.input, "model", any_version);
  const std::vector<Index> row_of = in.vector<Index>("surface/rows");
  const auto free =
      static_cast<std::size_t>(std::count_if(row_of.begin(), row_of.end(), [](Index r) { return r >= 0; }));
  const std::size_t nodes = rows(in, "mesh/nodes"), tets = rows(in, "mesh/tets");
  const auto order = in.version() < 2 ? std::int64_t{1} : in.integer("order");
  facts.add("model", fmt::format("{} {} tetrahedra on {}", tets, order == 1 ? "linear" : "quadratic",
                                 count(nodes, "corner", "corners")));
  facts.add("surface", fmt::format("{} nodes, {} of them free, {} triangles", row_of.size(), free,
                                   rows(in, "surface/triangles")));
  const std::vector<double> vertices = in.vector<double>("surface/vertices");
  Box box;
  for (std::size_t i = 0; i + 2 < vertices.size(); i += 3)
    box.add(Vec3(vertices[i], vertices[i + 1], vertices[i + 2]));
  facts.add_box(box, "");
  add_materials(in, facts);
  add_list(in, "anchors", facts);
  add_list(in, "beddings", facts);
  const std::string storage = in.text("storage");
  std::size_t bytes = storage == storage_name(Storage::half) ? 18 * free * free : 36 * free * free;
  if (in.has("compliance/values")) bytes = 4 * rows(in, "compliance/values");
  facts.add("compliance",
            fmt::format("{}, {} free rows, {} in memory", storage, 3 * free, human_bytes(bytes)));
  if (storage == storage_name(Storage::hierarchical)) {
    facts.add("certificate", fmt::format("relative error of a block at most {:.2g}, tolerance {:.2g}",
                                         in.number("error"), in.number("tolerance")));
    facts.object["certified_error"] = in.number("error"), facts.object["tolerance"] = in.number("tolerance");
  }
  const Discretisation error = read_discretisation(in);
  facts.add("error", to_string(error));
  if (error.against)
    facts.object["discretisation"] = {{"too_stiff", error.stiffness},
                                      {"displacement_error", error.displacement},
                                      {"against_order", error.against},
                                      {"jaw_at_m", {error.at.x(), error.at.y(), error.at.z()}},
                                      {"jaw_radius_m", error.radius}};
  if (in.has("drawing/vertices")) {
    facts.object["drawing"] = {{"vertices", rows(in, "drawing/vertices")},
                               {"triangles", rows(in, "drawing/triangles")},
                               {"error_rms", in.number("drawing_error_rms")},
                               {"error_max", in.number("drawing_error_max")}};
    facts.add("drawing", drawing_text(rows(in, "drawing/triangles"), rows(in, "drawing/vertices"),
                                      in.number("drawing_error_rms"), in.number("drawing_error_max")));
  }
  facts.add("made of", in.text("provenance"));
  facts.object.update({{"nodes", nodes},
                       {"tets", tets},
                       {"order", order},
                       {"surface_nodes", row_of.size()},
                       {"free_nodes", free},
                       {"storage", storage},
                       {"provenance", in.text("provenance")},
                       {"version", in.version()}});
  if (options.verify) read_organ(options.input, true, console.progress("verify"));
}

void info_recording(const InfoOptions& options, Facts& facts) {
  const Recording r = Recording::read(options.input);
  const ContainerReader in(options.input, "recording", any_version);
  facts.add("recording", fmt::format("{} of {} and {}, {}", count(r.ticks(), "tick", "ticks"),
                                     count(r.organs(), "organ", "organs"),
                                     count(r.instruments(), "instrument", "instruments"),
                                     count(r.hashes() + 1, "hash", "hashes")));
  facts.add(r.organs() > 1 ? "organs" : "organ", fmt::format("hash {:016x}", r.organ()));
  facts.add("made of", in.text("provenance"));
  facts.object.update({{"ticks", r.ticks()},
                       {"organs", r.organs()},
                       {"instruments", r.instruments()},
                       {"hashes", r.hashes() + 1},
                       {"provenance", in.text("provenance")},
                       {"version", in.version()}});
}

}  // namespace

std::string drawing_text(std::size_t triangles, std::size_t vertices, double rms, double most) {
  std::string text = fmt::format("{} triangles on {} vertices", triangles, vertices);
  if (rms >= 0)
    text += fmt::format("; its displacement is off by {:.2g} % of the largest (RMS; most {:.2g} %)",
                        100 * rms, 100 * most);
  return text;
}

void info_container(const InfoOptions& options, const std::string& kind, const Console& console) {
  Facts facts(options.input, kind);
  if (kind == "lattice" && container_kind(options.input).empty())
    info_text_lattice(options, facts);
  else if (kind == "lattice")
    info_lattice(options, facts);
  else if (kind == "band lattice")
    info_band(options, facts);
  else if (kind == "model")
    info_model(options, facts, console);
  else if (kind == "recording")
    info_recording(options, facts);
  else
    throw Error(ErrorKind::format, "{}: a container of kind \"{}\", of which nothing is known here",
                options.input.string(), kind);
  if (options.verify) facts.add("verified", "all checksums, and every number in its range");
  facts.object["verified"] = options.verify;
  facts.print(console);
}

}  // namespace palpate
