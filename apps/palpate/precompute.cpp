#include <fmt/ranges.h>

#include <charconv>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "info.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/compliance/storage.hpp"
#include "palpate/io/surface_file.hpp"
#include "palpate/io/tet_file.hpp"
#include "palpate/simulation/materials.hpp"
#include "palpate/simulation/organ.hpp"
#include "run.hpp"

namespace palpate {

namespace {

std::optional<Storage> parse_storage(const std::string& text) {
  if (text == "auto") return std::nullopt;
  if (text == "dense") return Storage::dense;
  if (text == "half") return Storage::half;
  if (text == "factored") return Storage::factored;
  if (text == "hierarchical") return Storage::hierarchical;
  throw Error(ErrorKind::usage, "--storage {}: say auto, dense, half, factored or hierarchical", text);
}

// "500M", "4G", or bytes.
std::size_t parse_memory(const std::string& text) {
  if (text.empty()) return 0;
  double value = 0;
  const auto [stop, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  const std::string unit(stop, text.data() + text.size());
  const double factor = unit == "G" || unit == "GB"   ? 1e9
                        : unit == "M" || unit == "MB" ? 1e6
                        : unit.empty()                ? 1
                                                      : 0;
  if (status != std::errc() || !(value * factor >= 1 && value * factor < 1e15))
    throw Error(ErrorKind::usage, "--memory {}: say bytes, as in 500M or 4G", text);
  return static_cast<std::size_t>(value * factor);
}

}  // namespace

void run_precompute(const PrecomputeOptions& options, const Console& console) {
  const double unit = unit_in_metres(options.unit);
  BakeOptions bake_options{options.order, parse_storage(options.storage), options.tolerance,
                           parse_memory(options.memory)};
  for (const std::string& text : options.beddings) bake_options.beddings.push_back(parse_bedding(text, unit));
  if (!options.drawing.empty()) bake_options.drawing = read_surface(options.drawing, unit).mesh;
  bake_options.pinch = options.pinch;
  if (!(bake_options.tolerance >= smallest_tolerance && bake_options.tolerance < 1))
    throw Error(ErrorKind::usage, "--tolerance {}: {} to 1; for exact compliances use --storage factored",
                bake_options.tolerance, smallest_tolerance);
  Timer timer = wall_timer();
  TetFile file = read_tets(options.input, unit);
  if (file.inverted)
    throw Error(ErrorKind::geometry, "{}: {} tetrahedra are inverted (from 0: {}{}); mend the mesh",
                options.input.string(), file.inverted, fmt::join(quality(file.mesh).inverted_at, ", "),
                file.inverted > 10 ? ", ..." : "");
  stage_line(console, "mesh",
             fmt::format("{} nodes, {} tetrahedra, regions {}", file.mesh.nodes.size(), file.mesh.tets.size(),
                         fmt::join(file.mesh.region_names, ", ")),
             timer.seconds(), 0);
  std::vector<Material> materials = materials_of(file, parse_region_materials(options.materials));
  std::vector<Anchor> anchors;
  for (const std::string& text : options.anchors) anchors.push_back(parse_anchor(text, unit));

  BakeReport r;
  Organ organ;
  {
    const Progress progress = console.progress("precompute");
    organ = bake(std::move(file.mesh), std::move(materials), std::move(anchors), console.threads, progress,
                 &r, bake_options);
  }
  stage_line(
      console, "stiffness",
      fmt::format("{} unknowns, {} tetrahedra", 3 * r.nodes, options.order == 1 ? "linear" : "quadratic"),
      r.assemble_seconds, 0);
  stage_line(console, "factor",
             fmt::format("{} entries of L, ordered in {}", r.factor_entries, human_time(r.order_seconds)),
             r.factor_seconds, 8 * r.factor_entries);
  stage_line(console, "compliance",
             fmt::format("{} of {} surface nodes are free; {}", r.free_surface_nodes, r.surface_nodes,
                         organ.compliance.storage()),
             r.sweep_seconds, organ.compliance.bytes());
  if (options.pinch) stage_line(console, "error", to_string(organ.discretisation), r.pinch_seconds, 0);
  if (!organ.drawing.empty())
    console.line(fmt::format(
        "{:<11} {}", "drawing",
        drawing_text(organ.drawing.surface.triangles.size(), organ.drawing.surface.vertices.size(),
                     organ.drawing.error_rms, organ.drawing.error_max)));
  const auto* hierarchical = organ.compliance.as<HierarchicalCompliance>();
  if (hierarchical)
    console.line(
        fmt::format("{:<11} relative error of a block at most {:.2g}, tolerance {:.2g}; positive definite",
                    "certificate", hierarchical->matrix().error, hierarchical->matrix().tolerance));
  timer = wall_timer();
  write_organ(options.output, organ,
              fmt::format("palpate {} precompute {}", PALPATE_VERSION, options.input.filename().string()),
              console.progress("write"));
  stage_line(console, "model", options.output.string(), timer.seconds(),
             std::filesystem::file_size(options.output));
  console.object(
      {{"model", options.output.string()},
       {"nodes", r.nodes},
       {"tets", r.tets},
       {"order", organ.order},
       {"surface_nodes", r.surface_nodes},
       {"free_surface_nodes", r.free_surface_nodes},
       {"factor_entries", r.factor_entries},
       {"assemble_s", r.assemble_seconds},
       {"order_s", r.order_seconds},
       {"factor_s", r.factor_seconds},
       {"sweep_s", r.sweep_seconds},
       {"pinch_s", r.pinch_seconds},
       {"too_stiff", options.pinch ? nlohmann::json(organ.discretisation.stiffness) : nullptr},
       {"displacement_error", options.pinch ? nlohmann::json(organ.discretisation.displacement) : nullptr},
       {"drawing_error_rms",
        organ.drawing.error_rms >= 0 ? nlohmann::json(organ.drawing.error_rms) : nullptr},
       {"storage", organ.compliance.storage()},
       {"storage_bytes", organ.compliance.bytes()},
       {"certified_error", hierarchical ? nlohmann::json(hierarchical->matrix().error) : nullptr},
       {"bytes", std::filesystem::file_size(options.output)},
       {"peak_memory_bytes", peak_resident_bytes()}});
}

}  // namespace palpate
