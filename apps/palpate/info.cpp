// What a file holds: surface, tetrahedra, label volume, lattice or model.
#include <fmt/core.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "palpate/geometry/check.hpp"
#include "palpate/io/nifti.hpp"
#include "palpate/io/surface_file.hpp"

namespace palpate {

namespace {

using nlohmann::json;

struct Fact {
  std::string name, text;
};

void print(const Console& console, const std::vector<Fact>& facts, const json& object) {
  for (const Fact& f : facts) console.line(fmt::format("{:<12}{}", f.name, f.text));
  console.object(object);
}

std::string count(std::size_t n, const std::string& one, const std::string& many) {
  return fmt::format("{} {}", n, n == 1 ? one : many);
}

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

void add_box(const Box& box, const std::string& unit, std::vector<Fact>& facts, json& object) {
  const Scale s = fitting(box.diagonal());
  const Vec3 size = s.per_metre * box.size();
  facts.push_back(
      {"box", fmt::format("{:.5g} x {:.5g} x {:.5g} {}, {} to {}", size.x(), size.y(), size.z(), s.length,
                          triple(s.per_metre * box.min), triple(s.per_metre * box.max))});
  if (box.diagonal() > 10 && unit == "m")
    facts.push_back({"", "big for a part of a body: were these millimetres? (--unit mm)"});
  object["box"] = {{"min", as_json(box.min)}, {"max", as_json(box.max)}};
}

// Facts of a surface that stand for themselves as well as for the boundary of tetrahedra.
void add_surface(const MeshReport& r, std::vector<Fact>& facts, json& object) {
  const Scale s = fitting(r.box.diagonal());
  const bool sure = r.closed() && r.oriented();
  facts.push_back({"closed", yes_no(r.closed(), count(r.open_edges, "open edge", "open edges") + ", " +
                                                    count(r.nonmanifold_edges, "edge", "edges") +
                                                    " of three triangles or more")});
  facts.push_back({"oriented", yes_no(r.oriented(), count(r.flipped_edges, "edge", "edges") +
                                                        " between triangles that face opposite ways") +
                                   (!sure          ? ""
                                    : r.volume < 0 ? ", inwards: it will be turned round"
                                                   : ", outwards")});
  facts.push_back({"parts", fmt::format("{}", r.components)});
  if (r.duplicate_triangles > 0)
    facts.push_back(
        {"duplicates", count(r.duplicate_triangles, "triangle", "triangles") + " on the corners of another"});
  facts.push_back({"area", fmt::format("{:.6g} {}", r.area * s.per_area, s.area)});
  facts.push_back({"volume", fmt::format("{:.6g} {}{}", r.volume * s.per_volume, s.volume,
                                         sure ? "" : ", by the divergence theorem; of little meaning here")});
  facts.push_back({"hedgehog", fmt::format("the area vectors sum to {:.2g} of the area{}",
                                           r.area > 0 ? r.area_sum.norm() / r.area : 0.0,
                                           r.closed() ? "" : " (closed and oriented: 0)")});
  object["surface"] = {{"vertices", r.vertices},
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
  std::vector<Fact> facts{
      {"surface", fmt::format("{} on {}, {}", count(report.triangles, "triangle", "triangles"),
                              count(report.vertices, "vertex", "vertices"), file.format)}};
  json object{
      {"file", options.input.string()}, {"kind", "surface"}, {"format", file.format}, {"unit", options.unit}};
  add_box(report.box, options.unit, facts, object);
  add_surface(report, facts, object);
  const WeldReport& w = file.weld;
  facts.push_back(
      {"read",
       fmt::format("{} merged with one at the same place, {} without area dropped, {} dropped",
                   count(w.welded, "vertex", "vertices"), count(w.degenerate, "triangle", "triangles"),
                   count(w.unused, "unused vertex", "unused vertices"))});
  object["read"] = {{"welded", w.welded}, {"degenerate", w.degenerate}, {"unused", w.unused}};
  print(console, facts, object);
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
  std::vector<Fact> facts{
      {"labels", fmt::format("{} x {} x {} voxels of {:.4g} x {:.4g} x {:.4g} mm, NIfTI", n[0], n[1], n[2],
                             1e3 * voxel.x(), 1e3 * voxel.y(), 1e3 * voxel.z())}};
  json object{{"file", options.input.string()},
              {"kind", "labels"},
              {"size", n},
              {"voxel_m", as_json(voxel)},
              {"labels", json::array()}};
  add_box(box, "", facts, object);
  const double cell = std::abs(axes.determinant());
  std::size_t shown = 0;
  for (const auto& [label, voxels] : counts) {
    const double m3 = cell * static_cast<double>(voxels);
    object["labels"].push_back({{"label", label}, {"voxels", voxels}, {"volume_m3", m3}});
    if (shown++ < 64)
      facts.push_back(
          {fmt::format("{}", label), fmt::format("{:>9} voxels  {:>9.4g} cm3", voxels, 1e6 * m3)});
  }
  if (shown > 64)
    facts.push_back({"...", fmt::format("{} different values in all: an image rather than labels?", shown)});
  print(console, facts, object);
}

}  // namespace

void run_info(const InfoOptions& options, const Console& console) {
  if (is_label_file(options.input)) return info_labels(options, console);
  info_surface(options, console);
}

}  // namespace palpate
