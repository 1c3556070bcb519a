// palpate lattice: a surface in, a lattice out, and what it is worth.
#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/geometry/check.hpp"
#include "palpate/io/surface_file.hpp"
#include "palpate/lattice/band_lattice.hpp"
#include "palpate/lattice/lattice_file.hpp"

namespace palpate {

namespace {

constexpr int error_points = 10000;

enum class Format { h5, text, vti };

Format format_of(const LatticeOptions& o) {
  const std::string extension = o.output.extension().string();
  if (o.format == "h5") return Format::h5;
  if (o.format == "text") return Format::text;
  if (o.format == "vti") return Format::vti;
  if (o.format != "auto") throw Error(ErrorKind::usage, "--format {}: say auto, h5, text or vti", o.format);
  if (o.output == "-" || extension == ".txt" || extension == ".lattice") return Format::text;
  if (extension == ".h5" || extension == ".hdf5") return Format::h5;
  if (extension == ".vti") return Format::vti;
  throw Error(ErrorKind::usage, "{}: the extension says no format (.h5, .txt, .vti); give --format",
              o.output.string());
}

std::optional<SignMethod> sign_of(const std::string& text) {
  if (text == "auto") return {};
  if (text == "pseudonormal") return SignMethod::pseudonormal;
  if (text == "winding") return SignMethod::winding;
  throw Error(ErrorKind::usage, "--sign {}: say auto, pseudonormal or winding", text);
}

std::string plural(std::size_t n, const std::string& one, const std::string& many) {
  return fmt::format("{} {}", n, n == 1 ? one : many);
}

std::string closedness(const MeshReport& r) {
  std::string text = r.closed() ? "closed" : "open";
  if (r.open_edges > 0) text += ", " + plural(r.open_edges, "open edge", "open edges");
  if (r.nonmanifold_edges > 0)
    text += ", " + plural(r.nonmanifold_edges, "edge of three triangles or more",
                          "edges of three triangles or more");
  if (r.flipped_edges > 0)
    text += ", " + plural(r.flipped_edges, "edge between opposite sides", "edges between opposite sides");
  else if (r.closed())
    text += " and oriented";
  if (r.duplicate_triangles > 0)
    text += ", " + plural(r.duplicate_triangles, "duplicate triangle", "duplicate triangles");
  return text;
}

struct Run {
  SurfaceFile file;
  MeshReport report;
  Grid grid;
  LatticeSamples samples;  // one of the two
  BandSamples band;
  InterpolationError error;
  double read_seconds = 0, tree_seconds = 0, fill_seconds = 0;
};

void show(const LatticeOptions& o, const Run& run, const SignedDistanceField& field, const Console& console) {
  const Grid& g = run.grid;
  const MeshReport& r = run.report;
  const bool banded = o.band > 0;
  const std::size_t sampled = banded ? run.band.distance.size() : g.size();
  const auto memory = banded ? run.band.center.size() * (sizeof(double) + sizeof(std::int32_t)) +
                                   sampled * (sizeof(double) + 2 * sizeof(Vec3))
                             : sampled * (sizeof(double) + sizeof(Vec3));
  console.line(fmt::format("surface   {} triangles, {} vertices, {} ({}), {}", r.triangles, r.vertices,
                           plural(r.components, "part", "parts"), closedness(r),
                           human_time(run.read_seconds)));
  std::string sign = name(field.method());
  if (!field.reason().empty()) sign += " (" + field.reason() + ")";
  if (field.flipped()) sign += "; the surface faced inwards and was turned over";
  if (field.flipped_parts() > 0)
    sign += fmt::format("; {} faced inwards and were turned over",
                        plural(field.flipped_parts(), "part", "parts"));
  console.line(fmt::format("sign      {}; tree {}", sign, human_time(run.tree_seconds)));
  console.line(
      fmt::format("grid      {} x {} x {} = {} points, h = {:.6g} m", g.n[0], g.n[1], g.n[2], g.size(), g.h));
  if (banded)
    console.line(
        fmt::format("band      {:.4g} m, {} of {} bricks of 8 x 8 x 8 points; lower bounds elsewhere",
                    run.band.band, run.band.slots(), run.band.slot.size()));
  console.line(fmt::format("samples   {} ({:.0f} ns a point of the grid), {}", human_time(run.fill_seconds),
                           1e9 * run.fill_seconds / static_cast<double>(g.size()), human_bytes(memory)));
  console.line(
      fmt::format("error     trilinear against exact at {} random points{}: max {:.3g} m ({:.3g} h), RMS "
                  "{:.3g} m ({:.3g} h)",
                  error_points, banded ? " in the bricks" : "", run.error.max, run.error.max / g.h,
                  run.error.rms, run.error.rms / g.h));
  console.line(fmt::format("written   {}", o.output.string()));
  console.object({{"input", o.input.string()},
                  {"output", o.output.string()},
                  {"format", run.file.format},
                  {"triangles", r.triangles},
                  {"vertices", r.vertices},
                  {"parts", r.components},
                  {"closed", r.closed()},
                  {"oriented", r.oriented()},
                  {"open_edges", r.open_edges},
                  {"nonmanifold_edges", r.nonmanifold_edges},
                  {"flipped_edges", r.flipped_edges},
                  {"duplicate_triangles", r.duplicate_triangles},
                  {"sign", name(field.method())},
                  {"sign_reason", field.reason()},
                  {"turned_over", field.flipped()},
                  {"parts_turned_over", field.flipped_parts()},
                  {"n", g.n},
                  {"points", g.size()},
                  {"band_m", run.band.band},
                  {"sampled_points", sampled},
                  {"spacing_m", g.h},
                  {"origin_m", {g.origin.x(), g.origin.y(), g.origin.z()}},
                  {"read_s", run.read_seconds},
                  {"tree_s", run.tree_seconds},
                  {"fill_s", run.fill_seconds},
                  {"memory_bytes", memory},
                  {"peak_memory_bytes", peak_resident_bytes()},
                  {"error_max_m", run.error.max},
                  {"error_rms_m", run.error.rms},
                  {"error_max_h", run.error.max / g.h},
                  {"error_rms_h", run.error.rms / g.h}});
}

}  // namespace

void run_lattice(const LatticeOptions& o, const Console& console) {
  const Format format = format_of(o);
  const std::optional<SignMethod> sign = sign_of(o.sign);
  const double unit = unit_in_metres(o.unit);
  const bool to_stdout = o.output == "-";
  if (to_stdout && (console.json || format != Format::text))
    throw Error(ErrorKind::usage, "-o - prints the text format alone; give a file name for {}",
                console.json ? "--json" : "other formats");
  if (o.spacing < 0) throw Error(ErrorKind::usage, "--spacing must be positive");
  if (o.band != 0 && !(o.band >= 1)) throw Error(ErrorKind::usage, "--band {}: at least 1 (cell)", o.band);
  if (o.band > 0 && format != Format::h5)
    throw Error(ErrorKind::usage, "--band: only .h5 holds a band; text and .vti are whole grids");

  Run run;
  Timer clock = wall_timer();
  run.file = read_surface(o.input, unit);
  run.report = check(run.file.mesh);
  run.read_seconds = clock.seconds();
  const Box& box = run.report.box;
  run.grid = [&] {
    try {
      return o.spacing > 0 ? make_grid_spaced(box, o.spacing * unit, o.margin * unit)
                           : make_grid(box, o.subdivisions, o.margin * unit);
    } catch (const Error& error) {
      throw Error(error.kind(), "{}: {}", o.input.string(), error.what());
    }
  }();
  clock = wall_timer();
  const SignedDistanceField field(run.file.mesh, sign);
  run.tree_seconds = clock.seconds();
  clock = wall_timer();
  const Progress progress = console.progress("lattice");
  if (o.band > 0)
    run.band = sample_band(field, run.grid, o.band * run.grid.h, console.threads, progress);
  else
    run.samples = sample_lattice(field, run.grid, console.threads, progress);
  run.fill_seconds = clock.seconds();

  if (to_stdout) {
    write_lattice_text([](std::string_view text) { fmt::print("{}", text); }, run.samples);
    return;
  }
  run.error = o.band > 0 ? estimate_error(field, run.band, error_points)
                         : estimate_error(field, run.samples, error_points);
  const std::string provenance =
      fmt::format("{}, 1 unit = {} m, sign by {}", o.input.filename().string(), unit, name(field.method()));
  if (format == Format::text) write_lattice_text(o.output, run.samples);
  if (format == Format::vti) write_lattice_vti(o.output, run.samples);
  if (format == Format::h5 && o.band > 0) write_band(o.output, run.band, run.file.mesh, provenance);
  if (format == Format::h5 && o.band == 0) write_lattice(o.output, run.samples, run.file.mesh, provenance);
  show(o, run, field, console);
}

}  // namespace palpate
