// The whole path in one command: a kidney with a stone, pressed by the chess bishop of the thesis (T
// fig. 6.1).
#include <fmt/core.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/geometry/check.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/io/surface_file.hpp"
#include "palpate/lattice/lattice_file.hpp"
#include "palpate/pad/pad.hpp"
#include "run.hpp"

namespace palpate {

namespace {

constexpr double bishop_scale = 1.0;  // of the file's metres: an instrument 7 cm long on a base of 31 mm

std::filesystem::path instrument_file(const DemoOptions& options) {
  if (!options.instrument.empty()) return options.instrument;
  const std::filesystem::path bishop = "/usr/share/inventor/data/models/chess/bishop.iv";
  if (!std::filesystem::exists(bishop))
    throw Error(
        ErrorKind::file,
        "{}: not there; install Debian's package inventor-data (./demo does), or give --instrument FILE",
        bishop.string());
  return bishop;
}

Organ make_organ(const DemoOptions& options, const Console& console) {
  Timer timer = wall_timer();
  const TriangleMesh kidney = make_kidney(options.nodes), stone = make_stone(150);
  const MeshReport report = check(kidney);
  stage_line(console, "surface",
             fmt::format("kidney of {} vertices, {:.0f} cm3, with a stone of {} vertices", report.vertices,
                         1e6 * report.volume, stone.vertices.size()),
             timer.seconds(), 0);
  write_surface(options.output / "kidney.stl", kidney);
  write_surface(options.output / "stone.stl", stone);

  timer = wall_timer();
  Padded padded;
  {
    const Progress progress = console.progress("pad");
    padded = pad_delaunay(kidney, {{"stone", stone}}, {}, progress);
  }
  stage_line(console, "pad",
             fmt::format("{} nodes, {} tetrahedra, angles {:.1f} to {:.1f} degrees", padded.mesh.nodes.size(),
                         padded.mesh.tets.size(), padded.report.quality.min_dihedral,
                         padded.report.quality.max_dihedral),
             timer.seconds(), 0);

  BakeReport r;
  Organ organ;
  {
    const Progress progress = console.progress("compliance");
    // Tissue of 10 kPa, a stone of 1 GPa; the back of the kidney rests against the body.
    organ = bake(std::move(padded.mesh), {{10e3, 0.45, 1050}, {1e9, 0.3, 2000}},
                 {AnchorHalfSpace{Vec3(0, 0, -0.016), Vec3::UnitZ()}}, console.threads, progress, &r);
  }
  stage_line(console, "stiffness",
             fmt::format("{} unknowns; {} of {} surface nodes are free", 3 * r.nodes, r.free_surface_nodes,
                         r.surface_nodes),
             r.assemble_seconds, 0);
  stage_line(console, "factor", fmt::format("{} entries of L", r.factor_entries),
             r.order_seconds + r.factor_seconds, 8 * r.factor_entries);
  stage_line(console, "error", to_string(organ.discretisation), r.pinch_seconds, 0);
  stage_line(console, "compliance", organ.compliance.storage(), r.sweep_seconds, organ.compliance.bytes());
  timer = wall_timer();
  const std::filesystem::path path = options.output / "kidney.h5";
  write_organ(path, organ, "palpate demo", console.progress("write"));
  stage_line(console, "model", path.string(), timer.seconds(), std::filesystem::file_size(path));
  return organ;
}

Instrument make_instrument(const DemoOptions& options, const Console& console) {
  const Timer timer = wall_timer();
  const std::filesystem::path file = instrument_file(options);
  Instrument out;
  out.name = "bishop";
  out.surface = read_surface(file, bishop_scale).mesh;
  const Box box = bounding_box(out.surface.vertices);
  const Grid grid = make_grid(box, 24, box.size().minCoeff() / 20);
  LatticeSamples samples;
  {
    const Progress progress = console.progress("lattice");
    samples = sample_lattice(SignedDistanceField(out.surface), grid, console.threads, progress);
  }
  out.shape = std::make_shared<const Lattice>(samples);
  const std::filesystem::path path = options.output / "bishop.h5";
  write_lattice(path, samples, out.surface, "palpate demo " + file.filename().string());
  stage_line(console, "lattice",
             fmt::format("{} of {} triangles: {} x {} x {} points, h = {:.2f} mm", file.filename().string(),
                         out.surface.triangles.size(), grid.n[0], grid.n[1], grid.n[2], 1e3 * grid.h),
             timer.seconds(), std::filesystem::file_size(path));
  return out;
}

// Approaches base first from above, presses in, slides along the kidney while it turns, and leaves.
MotionFile make_motion(const Organ& organ, std::size_t steps, double dt) {
  const Box kidney = bounding_box(organ.surface.vertices);
  const double press = 0.0115;
  struct Key {
    double t, y, height, tilt, turn;  // share of the run; m along the kidney; m above its top; degrees
  };
  const std::vector<Key> keys{{0.00, -0.016, 0.022, 12, 0},  {0.15, -0.016, 0.001, 12, 0},
                              {0.38, -0.016, -press, 12, 0}, {0.74, 0.012, -press, 12, 45},
                              {0.88, 0.012, 0.001, 12, 45},  {1.00, 0.012, 0.022, 12, 45}};
  MotionFile file;
  for (const Key& k : keys) {
    Pose pose;  // the bishop stands on its y axis: y becomes up
    pose.rotation = Eigen::AngleAxisd((90 + k.tilt) * M_PI / 180, Vec3::UnitX()) *
                    Eigen::AngleAxisd(k.turn * M_PI / 180, Vec3::UnitY());
    pose.translation = Vec3(kidney.center().x(), k.y, kidney.max.z() + k.height);
    file.motion.times.push_back(k.t * static_cast<double>(steps - 1) * dt);
    file.motion.poses.push_back({pose});
    file.organs.push_back({Pose{}});
  }
  return file;
}

// The folder is a scene of its own: palpate simulate FOLDER/scene.toml runs it again, and it can be edited.
void write_scene(const DemoOptions& options, double dt) {
  AtomicFile out(options.output / "scene.toml");
  out.write(
      fmt::format("# The demo as a scene: palpate simulate {} -o out/again\n",
                  (options.output / "scene.toml").string()) +
      "# Another instrument: replace lattice by sphere = \"20 mm\". Another law: mode = \"prescribed\".\n\n"
      "[organ]\nmodel = \"kidney.h5\"\n\n[[instrument]]\nname = \"bishop\"\nlattice = \"bishop.h5\"\n\n"
      "[motion]\nfile = \"motion.csv\"\n" +
      fmt::format("dt = {}\n\n", dt) + "[settings]\nmode = \"unilateral\"\n");
  out.commit();
}

}  // namespace

void run_demo(const DemoOptions& options, const Console& console) {
  if (options.nodes < 100 || options.nodes > 20000)
    throw Error(ErrorKind::usage, "--nodes {}: use 100 to 20000", options.nodes);
  if (options.steps < 12) throw Error(ErrorKind::usage, "--steps {}: use at least 12", options.steps);
  std::error_code failure;
  std::filesystem::create_directories(options.output, failure);
  if (failure)
    throw Error(ErrorKind::file, "{}: cannot create the folder: {}", options.output.string(),
                failure.message());

  const Timer offline = wall_timer();
  Scene scene;
  Model& model = scene.models.emplace_back();
  scene.organs = {"organ"};
  model.organ = make_organ(options, console);
  model.instruments.push_back(make_instrument(options, console));
  scene.dt = 0.001;
  scene.steps = options.steps;
  scene.motion = make_motion(model.organ, scene.steps, scene.dt);
  write_motion(options.output / "motion.csv", scene.motion, {"bishop"});
  write_scene(options, scene.dt);
  console.line(
      fmt::format("{:<11} {:<62} {:>9}", "offline", "all of the above", human_time(offline.seconds())));

  RunOptions run;
  run.folder = options.output;
  run.every = std::max<std::size_t>(1, options.steps / 96);
  run.pictures = options.pictures;
  run.view = Vec3(1, -0.45, 0.75);
  run.title = "palpate demo: a kidney with a stone, pressed by a bishop";
  const RunSummary summary = run_scene(scene, run, console);
  console.line("\n" + summary_table(summary) +
               fmt::format("\n  look at      {}\n  ParaView     {}\n  numbers      {}, {}",
                           (options.output / "contact_sheet.png").string(),
                           (options.output / "frames.pvd").string(), (options.output / "forces.csv").string(),
                           (options.output / "summary.json").string()));
  nlohmann::json object = nlohmann::json::parse(summary_json(summary));
  object["offline_s"] = offline.seconds();
  object["output"] = options.output.string();
  console.object(object);
}

}  // namespace palpate
