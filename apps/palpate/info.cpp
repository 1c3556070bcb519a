// What a file holds: surface, tetrahedra, label volume, lattice or model.
#include "info.hpp"

#include <fmt/ranges.h>

#include <cmath>
#include <map>

#include "palpate/geometry/check.hpp"
#include "palpate/io/container.hpp"
#include "palpate/io/nifti.hpp"
#include "palpate/io/surface_file.hpp"
#include "palpate/io/tet_file.hpp"

namespace palpate {

using nlohmann::json;

namespace {

std::string yes_no(bool yes, const std::string& but) { return yes ? "yes" : "no: " + but; }

json as_json(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

// The unit in which a body of this size is best told.
struct Scale {
  const char *length, *area, *volume;
  double per_metre, per_area, per_volume;
};
Scale fitting(double size) {
  if (size >= 1) return {"m", "m2", "m3", 1, 1, 1};
  if (size >= 1e-3) return {"mm", "cm2", "cm3", 1e3, 1e4, 1e6};
  return {"um", "um2", "um3", 1e6, 1e12, 1e18};
}

std::string triple(const Vec3& v) { return fmt::format("({:.5g}, {:.5g}, {:.5g})", v.x(), v.y(), v.z()); }

// A surface by itself, or the boundary of tetrahedra.
void add_surface(const MeshReport& r, Facts& facts) {
  const Scale s = fitting(r.box.diagonal());
  const bool sure = r.closed() && r.oriented();
  facts.add("closed", yes_no(r.closed(), count(r.open_edges, "open edge", "open edges") + ", " +
                                             count(r.nonmanifold_edges, "edge", "edges") +
                                             " of three triangles or more"));
  facts.add("oriented", yes_no(r.oriented(), count(r.flipped_edges, "edge", "edges") +
                                                 " between triangles that face opposite ways") +
                            (!sure          ? ""
                             : r.volume < 0 ? ", inwards: it will be turned round"
                                            : ", outwards"));
  facts.add("parts", fmt::format("{}", r.components));
  if (r.duplicate_triangles > 0)
    facts.add("duplicates",
              count(r.duplicate_triangles, "triangle", "triangles") + " on the corners of another");
  facts.add("area", fmt::format("{:.6g} {}", r.area * s.per_area, s.area));
  facts.add("volume", fmt::format("{:.6g} {}{}", r.volume * s.per_volume, s.volume,
                                  sure ? "" : ", by the divergence theorem; of little meaning here"));
  facts.add("hedgehog", fmt::format("the area vectors sum to {:.2g} of the area{}",
                                    r.area > 0 ? r.area_sum.norm() / r.area : 0.0,
                                    r.closed() ? "" : " (closed and oriented: 0)"));
  facts.object["surface"] = {{"vertices", r.vertices},
                             {"triangles", r.triangles},
                             {"closed", r.closed()},
                             {"oriented", r.oriented()},
                             {"components", r.components},
                             {"open_edges", r.open_edges},
                             {"nonmanifold_edges", r.nonmanifold_edges},
                             {"flipped_edges", r.flipped_edges},
                             {"duplicate_triangles", r.duplicate_triangles},
                             {"area_m2", r.area},
                             {"volume_m3", r.volume},
                             {"area_sum_m2", as_json(r.area_sum)}};
}

void info_surface(const InfoOptions& options, const Console& console) {
  const SurfaceFile file = read_surface(options.input, unit_in_metres(options.unit));
  const MeshReport report = check(file.mesh);
  Facts facts(options.input, "surface");
  facts.object["format"] = file.format, facts.object["unit"] = options.unit;
  facts.add("surface", fmt::format("{} on {}, {}", count(report.triangles, "triangle", "triangles"),
                                   count(report.vertices, "vertex", "vertices"), file.format));
  facts.add_box(report.box, options.unit);
  add_surface(report, facts);
  const WeldReport& w = file.weld;
  facts.add("read",
            fmt::format("{} merged with one at the same place, {} without area dropped, {} dropped",
                        count(w.welded, "vertex", "vertices"), count(w.degenerate, "triangle", "triangles"),
                        count(w.unused, "unused vertex", "unused vertices")));
  facts.object["read"] = {{"welded", w.welded}, {"degenerate", w.degenerate}, {"unused", w.unused}};
  facts.print(console);
}

void info_tets(const InfoOptions& options, const Console& console) {
  const TetFile file = read_tets(options.input, unit_in_metres(options.unit));
  const TetMesh& mesh = file.mesh;
  const TetQuality q = quality(mesh);
  Facts facts(options.input, "tetrahedra");
  facts.object["format"] = file.format, facts.object["unit"] = options.unit;
  facts.object["tets"] = mesh.tets.size(), facts.object["nodes"] = mesh.nodes.size();
  facts.add("tetrahedra", fmt::format("{} on {}, {}", mesh.tets.size(),
                                      count(mesh.nodes.size(), "node", "nodes"), file.format));
  const Box box = bounding_box(mesh.nodes);
  facts.add_box(box, options.unit);
  const Scale s = fitting(box.diagonal());
  std::vector<std::size_t> tets(mesh.region_names.size());
  std::vector<double> volumes(mesh.region_names.size());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const auto region = static_cast<std::size_t>(mesh.regions[t]);
    ++tets[region], volumes[region] += six_volume(mesh, mesh.tets[t]) / 6;
  }
  for (std::size_t r = 0; r < tets.size(); ++r) {
    facts.add(r == 0 ? "regions" : "", fmt::format("{}: {} tetrahedra, {:.6g} {}", mesh.region_names[r],
                                                   tets[r], volumes[r] * s.per_volume, s.volume));
    facts.object["regions"].push_back(
        {{"name", mesh.region_names[r]}, {"tets", tets[r]}, {"volume_m3", volumes[r]}});
  }
  facts.add("quality",
            fmt::format("dihedral angles {:.1f} to {:.1f} degrees, {} below 5, {} inverted or flat",
                        q.min_dihedral, q.max_dihedral, count(q.slivers, "sliver", "slivers"), q.inverted));
  if (q.worst >= 0) facts.add("worst", fmt::format("tetrahedron {} (from 0)", q.worst));
  if (q.inverted > 0)
    facts.add("inverted", fmt::format("tetrahedra {}{} (from 0)", fmt::join(q.inverted_at, ", "),
                                      q.inverted > 10 ? ", ..." : ""));
  for (const auto& [name, text] : histogram_lines(q)) facts.add(name, text);
  facts.object["quality"] = {{"min_dihedral_deg", q.min_dihedral},
                             {"max_dihedral_deg", q.max_dihedral},
                             {"slivers", q.slivers},
                             {"inverted", q.inverted},
                             {"worst_tet", q.worst},
                             {"inverted_tets", q.inverted_at},
                             {"histogram_10_deg", q.histogram},
                             {"volume_m3", {q.min_volume, q.max_volume}},
                             {"histogram_volume_over_mean_log2_from_minus_11", q.volumes}};
  const MeshReport report = check(boundary(mesh).surface);
  facts.add("boundary", fmt::format("{} on {}", count(report.triangles, "triangle", "triangles"),
                                    count(report.vertices, "node", "nodes")));
  add_surface(report, facts);
  facts.add("read", fmt::format("{} and {} left out, {} reduced to four nodes",
                                count(file.other_cells, "other cell", "other cells"),
                                count(file.unused_nodes, "unused node", "unused nodes"),
                                count(file.higher_order, "tetrahedron", "tetrahedra")));
  facts.object["read"] = {{"other_cells", file.other_cells},
                          {"unused_nodes", file.unused_nodes},
                          {"higher_order", file.higher_order}};
  facts.print(console);
}

void info_labels(const InfoOptions& options, const Console& console) {
  const LabelVolume volume = read_labels(options.input);
  std::map<std::int32_t, std::size_t> counts;
  for (const std::int32_t label : volume.labels) ++counts[label];
  const Mat3 axes = volume.to_world.leftCols<3>();
  const Vec3 voxel = axes.colwise().norm().transpose();
  const auto& n = volume.size;
  Box box;  // of the voxels' centres
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector4d at(0, 0, 0, 1);
    for (int i = 0; i < 3; ++i)
      at[i] = corner >> i & 1 ? static_cast<double>(n[static_cast<std::size_t>(i)] - 1) : 0;
    box.add(volume.to_world * at);
  }
  Facts facts(options.input, "labels");
  facts.object["size"] = n, facts.object["voxel_m"] = as_json(voxel), facts.object["labels"] = json::array();
  facts.add("labels", fmt::format("{} x {} x {} voxels of {:.4g} x {:.4g} x {:.4g} mm, NIfTI", n[0], n[1],
                                  n[2], 1e3 * voxel.x(), 1e3 * voxel.y(), 1e3 * voxel.z()));
  facts.add_box(box, "");
  const double cell = std::abs(axes.determinant());
  std::size_t shown = 0;
  for (const auto& [label, voxels] : counts) {
    const double m3 = cell * static_cast<double>(voxels);
    facts.object["labels"].push_back({{"label", label}, {"voxels", voxels}, {"volume_m3", m3}});
    if (shown++ < 64)
      facts.add(fmt::format("{}", label), fmt::format("{:>9} voxels  {:>9.4g} cm3", voxels, 1e6 * m3));
  }
  if (shown > 64)
    facts.add("...", fmt::format("{} different values in all: an image rather than labels?", shown));
  facts.print(console);
}

}  // namespace

std::string count(std::size_t n, const std::string& one, const std::string& many) {
  return fmt::format("{} {}", n, n == 1 ? one : many);
}

std::string bars(std::span<const std::size_t> counts) {
  static constexpr const char* levels[] = {" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  const std::size_t most = *std::max_element(counts.begin(), counts.end());
  std::string text;
  for (const std::size_t n : counts)
    text += levels[n == 0 ? 0 : std::max<std::size_t>(1, (8 * n + most / 2) / most)];
  return text;
}

std::vector<std::pair<std::string, std::string>> histogram_lines(const TetQuality& q) {
  const double per = q.max_volume < 1e-6 ? 1e9 : 1e6;
  return {{"angles", fmt::format("0 |{}| 180 degrees, bins of 10", bars(q.histogram))},
          {"volumes",
           fmt::format("mean / 2^11 |{}| mean x 2^6, bins of a factor of 2; {:.3g} to {:.3g} {}",
                       bars(q.volumes), per * q.min_volume, per * q.max_volume, per == 1e9 ? "mm3" : "cm3")}};
}

void Facts::add_box(const Box& box, const std::string& unit) {
  const Scale s = fitting(box.diagonal());
  const Vec3 size = s.per_metre * box.size();
  add("box", fmt::format("{:.5g} x {:.5g} x {:.5g} {}, {} to {}", size.x(), size.y(), size.z(), s.length,
                         triple(s.per_metre * box.min), triple(s.per_metre * box.max)));
  if (box.diagonal() > 10 && unit == "m")
    add("", "big for a part of a body: were these millimetres? (--unit mm)");
  object["box"] = {{"min", as_json(box.min)}, {"max", as_json(box.max)}};
}

void Facts::print(const Console& console) const {
  for (const auto& [name, text] : lines) console.line(fmt::format("{:<12}{}", name, text));
  console.object(object);
}

void run_info(const InfoOptions& options, const Console& console) {
  const std::string kind = container_kind(options.input);
  if (!kind.empty()) return info_container(options, kind, console);
  const std::string extension = options.input.extension().string();
  if (extension == ".txt" || extension == ".lattice") return info_container(options, "lattice", console);
  if (extension == ".handover")
    throw Error(ErrorKind::usage, "{}: convert it to .h5 first: palpate convert {} model.h5",
                options.input.string(), options.input.string());
  if (is_label_file(options.input)) return info_labels(options, console);
  if (is_tet_file(options.input)) return info_tets(options, console);
  info_surface(options, console);
}

}  // namespace palpate
