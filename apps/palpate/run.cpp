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
  std::vector<std::vector<Vec3>> organs;        // vertices, deformed, world
  std::vector<std::vector<float>> millimetres;  // displacement of each
  std::vector<std::vector<Vec3>> instruments;   // vertices, world
};

Shot take_shot(const Scene& scene, std::span<const State> states, const Input& input) {
  Shot shot;
  shot.time = input.time;
  for (std::size_t i = 0; i < input.instruments.size(); ++i)
    shot.force = std::max(shot.force, wrench_of(states, i).force.norm());
  for (std::size_t o = 0; o < states.size(); ++o) {
    const std::vector<Vec3>& rest = drawn_surface(scene.models[o].organ).vertices;
    const std::vector<Vec3>& now = shot.organs.emplace_back(drawn_vertices(scene.models[o], states[o]));
    std::vector<float>& moved = shot.millimetres.emplace_back();
    for (std::size_t i = 0; i < rest.size(); ++i)
      moved.push_back(static_cast<float>(1e3 * (now[i] - states[o].organ * rest[i]).norm()));
  }
  for (std::size_t i = 0; i < input.instruments.size(); ++i) {
    shot.instruments.emplace_back();
    for (const Vec3& v : scene.models[0].instruments[i].surface.vertices)
      shot.instruments.back().push_back(input.instruments[i] * v);
  }
  return shot;
}

float largest(const Shot& shot) {
  float most = 0;
  for (const std::vector<float>& organ : shot.millimetres)
    for (const float mm : organ) most = std::max(most, mm);
  return most;
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
  // The organs, and of the instruments what comes near them.
  std::vector<Vec3> shown;
  Box near;
  float most = 0;
  for (const Shot& s : shots) {
    for (const std::vector<Vec3>& organ : s.organs) {
      near.add(bounding_box(organ));
      shown.insert(shown.end(), organ.begin(), organ.end());
    }
    most = std::max(most, largest(s));
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
    std::vector<DrawnMesh> meshes;
    for (std::size_t o = 0; o < s.organs.size(); ++o) {
      DrawnMesh mesh;
      mesh.vertices = s.organs[o];
      mesh.triangles = drawn_surface(scene.models[o].organ).triangles;
      mesh.values = s.millimetres[o];
      meshes.push_back(mesh);
    }
    for (std::size_t i = 0; i < s.instruments.size(); ++i) {
      DrawnMesh mesh;
      mesh.vertices = s.instruments[i];
      mesh.triangles = scene.models[0].instruments[i].surface.triangles;
      meshes.push_back(mesh);
    }
    sheet.push_back({painter.draw(meshes, camera, 0, top),
                     fmt::format("{:.2f} s   {:.1f} mm   {:.2f} N", s.time, largest(s), s.force)});
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
  std::vector<State> states = make_states(scene.models);
  std::vector<Input> inputs = make_inputs(scene.models);
  Recorder recorder(options.folder, scene.models, scene.organs, options.every);
  std::vector<Shot> shots;
  Comparison compared{options.replay};
  {
    const Progress progress = console.progress("simulate");
    const double start = scene.motion.motion.times.front();
    for (std::size_t k = 0; k < scene.steps; ++k) {
      set_inputs(scene.motion, start + static_cast<double>(k) * scene.dt, inputs);
      if (options.replay) options.replay->set_inputs(k, inputs);
      step(scene.models, states, inputs);
      compared.see(k, states);
      if (options.record) options.record->add(inputs, states);
      recorder.add(k, states);
      // The first shot half a tile in: the sheet then shows the middle of each twelfth of the run.
      if (options.pictures && k == (2 * shots.size() + 1) * scene.steps / (2 * tiles))
        shots.push_back(take_shot(scene, states, inputs[0]));
      progress.at(static_cast<double>(k + 1) / static_cast<double>(scene.steps));
    }
  }
  const RunSummary summary = recorder.finish();
  compared.require_same(options.replayed_file);
  if (options.pictures && !shots.empty()) draw(scene, shots, options);
  return summary;
}

}  // namespace palpate
