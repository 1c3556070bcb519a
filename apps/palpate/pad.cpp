// palpate pad: a closed surface in, tetrahedra out, and what they are worth.
#include "palpate/pad/pad.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "info.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/geometry/check.hpp"
#include "palpate/io/nifti.hpp"
#include "palpate/io/surface_file.hpp"
#include "palpate/io/tet_file.hpp"
#include "palpate/pad/label_surface.hpp"

namespace palpate {

namespace {

using nlohmann::json;

std::vector<NamedSurface> read_regions(const PadCommandOptions& o, double unit) {
  std::vector<NamedSurface> inner;
  for (const std::string& region : o.regions) {
    const std::size_t equals = region.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == region.size())
      throw Error(ErrorKind::usage, "--region {}: say NAME=FILE", region);
    inner.push_back({region.substr(0, equals), read_surface(region.substr(equals + 1), unit).mesh});
  }
  return inner;
}

// The surface to pad, and those within.
struct Source {
  SurfaceFile file;
  std::vector<NamedSurface> inner;
  std::string name;  // of what lies in no inner surface
};

std::vector<std::int32_t> parse_labels_option(const std::string& text, std::string& name) {
  const std::size_t equals = text.find('=');
  std::vector<std::int32_t> labels;
  if (equals != std::string::npos && equals > 0) {
    name = text.substr(0, equals);
    std::size_t at = equals;
    while (at != std::string::npos) {
      const std::size_t end = text.find(',', at + 1);
      const std::string number = text.substr(at + 1, end == std::string::npos ? end : end - at - 1);
      std::int32_t label = 0;
      const auto [rest, error] = std::from_chars(number.data(), number.data() + number.size(), label);
      if (error != std::errc() || rest != number.data() + number.size())
        throw Error(ErrorKind::usage, "--labels {}: \"{}\" is no label; say NAME=1,2", text, number);
      labels.push_back(label);
      at = end;
    }
  }
  if (labels.empty()) throw Error(ErrorKind::usage, "--labels {}: say NAME=1,2", text);
  return labels;
}

Source read_label_source(const PadCommandOptions& o) {
  const LabelVolume volume = read_labels(o.input);
  Source out{{}, {}, o.name};
  std::vector<std::int32_t> all;
  for (std::size_t i = 0; i < o.labels.size(); ++i) {
    std::string name;
    const std::vector<std::int32_t> labels = parse_labels_option(o.labels[i], name);
    for (const std::int32_t l : labels)
      if (std::find(all.begin(), all.end(), l) != all.end())
        throw Error(ErrorKind::usage, "--labels: label {} is given twice", l);
    all.insert(all.end(), labels.begin(), labels.end());
    if (i == 0)
      out.name = name;
    else
      out.inner.push_back({name, label_surface(volume, labels)});
  }
  if (all.empty()) {
    all = volume.labels;
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    std::erase(all, 0);
    if (all.size() > 256)
      throw Error(ErrorKind::usage,
                  "{} has {} different values: an image, not labels? Say which to fill: --labels NAME=1,2",
                  o.input.string(), all.size());
  }
  out.file.mesh = label_surface(volume, all);
  out.file.format = "NIfTI";
  return out;
}

Source read_source(const PadCommandOptions& o, double unit) {
  if (is_label_file(o.input)) return read_label_source(o);
  if (!o.labels.empty())
    throw Error(ErrorKind::usage, "--labels: {} is no label volume (.nii, .nii.gz)", o.input.string());
  return {read_surface(o.input, unit), {}, o.name};
}

struct Region {
  std::string name;
  std::size_t tets = 0;
  double volume = 0;  // m3
};

std::vector<Region> regions_of(const TetMesh& mesh) {
  std::vector<Region> regions;
  for (const std::string& name : mesh.region_names) regions.push_back({name});
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    Region& r = regions[static_cast<std::size_t>(mesh.regions[t])];
    ++r.tets, r.volume += six_volume(mesh, mesh.tets[t]) / 6;
  }
  return regions;
}

// How well the boundary of a stuffed mesh follows the surface.
std::string distance_line(const PadReport& r, double area) {
  std::string text = fmt::format("within {:.3g} m of the surface ({:.2f} elements)", r.boundary_off,
                                 r.boundary_off / r.spacing);
  if (r.missed.empty()) return text + ", the surface within half an element of it";
  text += fmt::format("; too small for these elements: {:.3g} % of the surface, up to {:.3g} m away",
                      100 * r.missed_area / area, r.missed[0].distance);
  for (std::size_t i = 0; i < std::min<std::size_t>(r.missed.size(), 3); ++i)
    text += fmt::format("{} ({:.5g}, {:.5g}, {:.5g}) m", i == 0 ? ", near" : ",", r.missed[i].at.x(),
                        r.missed[i].at.y(), r.missed[i].at.z());
  return text + (r.missed.size() > 3 ? ", ..." : "");
}

std::string missing_line(const PadReport& r) {
  if (r.missing_triangles == 0 && r.region_missing == 0) return "all triangles of the surfaces are faces";
  std::string text = fmt::format("{} triangles of the surface", r.missing_triangles);
  if (r.region_missing > 0) text += fmt::format(" and {} of the regions' surfaces", r.region_missing);
  text += " are no faces";
  for (std::size_t i = 0; i < std::min<std::size_t>(r.missing_at.size(), 3); ++i)
    text += fmt::format("{} ({:.5g}, {:.5g}, {:.5g}) m", i == 0 ? ": near" : ",", r.missing_at[i].x(),
                        r.missing_at[i].y(), r.missing_at[i].z());
  return text + (r.missing_at.size() > 3 ? ", ...; see docs/pad.md" : "; see docs/pad.md");
}

json as_json(const PadReport& r, const std::vector<Region>& regions, bool stuffed) {
  const TetQuality& q = r.quality;
  json object{{"interior_nodes", r.interior_points},
              {"spacing_m", r.spacing},
              {"turned_over", r.flipped},
              {"crossings_repaired", r.repaired.crossings},
              {"vertices_moved", r.repaired.moved},
              {"moved_by_at_most_m", r.repaired.farthest},
              {"removed_outside", r.removed_outside},
              {"recovered_edges", r.recovered_edges},
              {"slivers_removed", r.slivers_removed},
              {"missing_triangles", r.missing_triangles},
              {"missing_at_m", json::array()},
              {"region_triangles_missing", r.region_missing},
              {"volume_m3", q.volume},
              {"min_dihedral_deg", q.min_dihedral},
              {"max_dihedral_deg", q.max_dihedral},
              {"slivers", q.slivers},
              {"regions", json::array()}};
  for (const Vec3& p : r.missing_at) object["missing_at_m"].push_back({p.x(), p.y(), p.z()});
  object["histogram_10deg"] = q.histogram;
  object["histogram_volume_over_mean_log2_from_minus_11"] = q.volumes;
  if (stuffed) {
    object.update({{"surface_nodes", r.surface_nodes},
                   {"warped_nodes", r.warped},
                   {"cut_nodes", r.cut},
                   {"kept_nodes", r.kept},
                   {"islands", r.islands},
                   {"islands_volume_m3", r.islands_volume},
                   {"boundary_off_m", r.boundary_off},
                   {"missed_area_m2", r.missed_area},
                   {"missed", json::array()}});
    for (const MissedFeature& m : r.missed)
      object["missed"].push_back({{"at_m", {m.at.x(), m.at.y(), m.at.z()}}, {"distance_m", m.distance}});
  }
  for (const Region& g : regions)
    object["regions"].push_back({{"name", g.name}, {"tets", g.tets}, {"volume_m3", g.volume}});
  return object;
}

void show(const PadCommandOptions& o, const SurfaceFile& file, const Padded& padded, double seconds,
          const Console& console) {
  const PadReport& r = padded.report;
  const std::vector<Region> regions = regions_of(padded.mesh);
  const auto line = [&](const char* name, const std::string& text) {
    console.line(fmt::format("{:<10}{}", name, text));
  };
  line("surface",
       fmt::format("{} triangles, {} vertices{}", file.mesh.triangles.size(), file.mesh.vertices.size(),
                   r.flipped ? "; it faced inwards and was turned over" : ""));
  if (r.repaired.crossings > 0)
    line("repaired",
         fmt::format("{} places where it ran through itself: {} vertices moved, by up to {:.3g} m",
                     r.repaired.crossings, r.repaired.moved, r.repaired.farthest));
  const bool stuffed = o.method == "stuffing";
  if (stuffed) {
    line("nodes", fmt::format("{}: {} on the surface, elements of {:.4g} m there{}", padded.mesh.nodes.size(),
                              r.surface_nodes, r.spacing, o.grade ? ", larger with depth" : ""));
    line("tets", fmt::format("{}, {:.6g} m3 (the surface: {:.6g})", padded.mesh.tets.size(), r.quality.volume,
                             std::abs(check(file.mesh).volume)));
    if (r.islands > 0)
      line("dropped", fmt::format("{} parts too small for these elements, {:.3g} m3 together", r.islands,
                                  r.islands_volume));
  } else {
    line("nodes", fmt::format("{}: {} interior, {:.4g} m apart near the surface{}", padded.mesh.nodes.size(),
                              r.interior_points, r.spacing, o.grade ? ", more with depth" : ""));
    line("tets", fmt::format("{}, {:.6g} m3; {} outside removed", padded.mesh.tets.size(), r.quality.volume,
                             r.removed_outside));
  }
  for (const Region& g : regions)
    line("region", fmt::format("{}: {} tetrahedra, {:.6g} m3", g.name, g.tets, g.volume));
  line("quality",
       fmt::format("dihedral angles {:.1f} to {:.1f} degrees, {} slivers (below 5){}", r.quality.min_dihedral,
                   r.quality.max_dihedral, r.quality.slivers,
                   r.slivers_removed ? fmt::format(", {} flat ones peeled off", r.slivers_removed) : ""));
  for (const auto& [name, text] : histogram_lines(r.quality)) line(name.c_str(), text);
  line("boundary", stuffed ? distance_line(r, check(file.mesh).area) : missing_line(r));
  line("time", fmt::format("{}, peak memory {}", human_time(seconds), human_bytes(peak_resident_bytes())));
  line("written", o.output.string());
  json object = as_json(r, regions, stuffed);
  object.update({{"input", o.input.string()},
                 {"output", o.output.string()},
                 {"format", file.format},
                 {"surface_triangles", file.mesh.triangles.size()},
                 {"surface_vertices", file.mesh.vertices.size()},
                 {"nodes", padded.mesh.nodes.size()},
                 {"tets", padded.mesh.tets.size()},
                 {"seconds", seconds},
                 {"peak_memory_bytes", peak_resident_bytes()}});
  console.object(object);
}

}  // namespace

void run_pad(const PadCommandOptions& options, const Console& console) {
  const double unit = unit_in_metres(options.unit);
  Source source = read_source(options, unit);
  const SurfaceFile& file = source.file;
  PadOptions how;
  if (options.method != "stuffing" && options.method != "delaunay")
    throw Error(ErrorKind::usage, "--method {}: stuffing or delaunay", options.method);
  how.method = options.method == "stuffing" ? PadMethod::stuffing : PadMethod::delaunay;
  how.surface_nodes = options.surface_nodes;
  how.spacing = options.spacing * unit;
  how.grade = options.grade;
  how.name = source.name;
  how.repair = options.repair;
  std::vector<NamedSurface> inner = read_regions(options, unit);
  inner.insert(inner.begin(), source.inner.begin(), source.inner.end());
  const Timer timer = wall_timer();
  Padded padded = [&] {
    try {
      return pad(file.mesh, inner, how, console.progress("padding"));
    } catch (const Error& e) {
      if (e.kind() == ErrorKind::interrupted) throw;
      throw Error(e.kind(), "{}: {}", options.input.string(), e.what());
    }
  }();
  const double seconds = timer.seconds();
  write_tets(options.output, padded.mesh);
  show(options, file, padded, seconds, console);
}

}  // namespace palpate
