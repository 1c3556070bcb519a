#include "run.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "palpate/base/timer.hpp"
#include "palpate/picture/picture.hpp"

namespace palpate {

namespace {

constexpr std::size_t tiles = 12;

// What a picture needs of a step, kept until the largest displacement of the run is known.
struct Shot {
  double time = 0;
  double force = 0;
  std::vector<Vec3> vertices;                  // deformed organ, world
  std::vector<float> millimetres;              // displacement of each
  std::vector<std::vector<Vec3>> instruments;  // vertices, world
};

Shot take_shot(const Model& model, const State& state, const Input& input) {
  Shot shot;
  shot.time = input.time;
  for (const Wrench& w : state.wrenches) shot.force = std::max(shot.force, w.force.norm());
  shot.vertices = drawn_vertices(model, state);
  const std::vector<Vec3>& rest = drawn_surface(model.organ).vertices;
  for (std::size_t i = 0; i < rest.size(); ++i)
    shot.millimetres.push_back(static_cast<float>(1e3 * (shot.vertices[i] - state.organ * rest[i]).norm()));
  for (std::size_t i = 0; i < model.instruments.size(); ++i) {
    shot.instruments.emplace_back();
    for (const Vec3& v : model.instruments[i].surface.vertices)
      shot.instruments.back().push_back(input.instruments[i] * v);
  }
  return shot;
}

// 1, 2 or 5 times a power of ten at or above x: a legend that ends on a round number.
double round_up(double x) {
  if (!(x > 0)) return 1;
  const double power = std::pow(10, std::floor(std::log10(x)));
  for (const double m : {1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0})
    if (m * power >= x * (1 - 1e-9)) return m * power;
  return 10 * power;
}

void draw(const Scene& scene, const std::vector<Shot>& shots, const RunOptions& options) {
  // The organ, and of the instruments what comes near it.
  std::vector<Vec3> shown;
  Box near;
  float most = 0;
  for (const Shot& s : shots) {
    near.add(bounding_box(s.vertices));
    shown.insert(shown.end(), s.vertices.begin(), s.vertices.end());
    for (const float mm : s.millimetres) most = std::max(most, mm);
  }
  const double top = round_up(most);
  const double reach = 0.35 * near.diagonal();
  near.add(Vec3(near.min.array() - reach)), near.add(Vec3(near.max.array() + reach));
  for (const Shot& s : shots)
    for (const std::vector<Vec3>& instrument : s.instruments)
      for (const Vec3& p : instrument)
        if ((p.array() > near.min.array()).all() && (p.array() < near.max.array()).all()) shown.push_back(p);
  const Camera camera = frame_points(shown, options.view, options.up);
  Painter painter(480, 480);
  std::vector<Tile> sheet;
  for (const Shot& s : shots) {
    std::vector<DrawnMesh> meshes(1);
    meshes[0].vertices = s.vertices;
    meshes[0].triangles = drawn_surface(scene.model.organ).triangles;
    meshes[0].values = s.millimetres;
    for (std::size_t i = 0; i < s.instruments.size(); ++i) {
      DrawnMesh mesh;
      mesh.vertices = s.instruments[i];
      mesh.triangles = scene.model.instruments[i].surface.triangles;
      meshes.push_back(mesh);
    }
    const float largest =
        s.millimetres.empty() ? 0 : *std::max_element(s.millimetres.begin(), s.millimetres.end());
    sheet.push_back({painter.draw(meshes, camera, 0, top),
                     fmt::format("{:.2f} s   {:.1f} mm   {:.2f} N", s.time, largest, s.force)});
  }
  write_png(options.folder / "contact_sheet.png",
            contact_sheet(sheet, 4, options.title, "displacement, mm", 0, top));
}

}  // namespace

void stage_line(const Console& console, const std::string& name, const std::string& what, double seconds,
                std::size_t bytes) {
  console.line(fmt::format("{:<11} {:<62} {:>9} {:>10}  ({} in use)", name, what, human_time(seconds),
                           bytes ? human_bytes(bytes) : "", human_bytes(resident_bytes())));
}

void Comparison::require_same(const std::filesystem::path& file) const {
  if (!with || differs_at == ~std::uint64_t{0}) return;
  throw Error(ErrorKind::format,
              "{}: the state after tick {} is not the one recorded; was its model precomputed on another "
              "machine, or is "
              "the program another version?",
              file.string(), differs_at);
}

RunSummary run_scene(const Scene& scene, const RunOptions& options, const Console& console) {
  State state = make_state(scene.model);
  Recorder recorder(options.folder, scene.model, options.every);
  std::vector<Shot> shots;
  Comparison compared{options.replay};
  {
    const Progress progress = console.progress("simulate");
    const double start = scene.motion.motion.times.front();
    for (std::size_t k = 0; k < scene.steps; ++k) {
      Input input = input_at(scene.motion, start + static_cast<double>(k) * scene.dt);
      if (options.replay) options.replay->set_input(k, input);
      step(scene.model, state, input);
      compared.see(k, state);
      if (options.record) options.record->add(input, state);
      recorder.add(k, input, state);
      // The first shot half a tile in: the sheet then shows the middle of each twelfth of the run.
      if (options.pictures && k == (2 * shots.size() + 1) * scene.steps / (2 * tiles))
        shots.push_back(take_shot(scene.model, state, input));
      progress.at(static_cast<double>(k + 1) / static_cast<double>(scene.steps));
    }
  }
  const RunSummary summary = recorder.finish();
  compared.require_same(options.replayed_file);
  if (options.pictures && !shots.empty()) draw(scene, shots, options);
  return summary;
}

}  // namespace palpate
