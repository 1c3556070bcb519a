#include <fmt/core.h>

#include <atomic>
#include <cmath>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/simulation/loop.hpp"
#include "run.hpp"

namespace palpate {

namespace {

// The scene's motion to and fro in real time.
void run_in_loop(const Scene& scene, const SimulateOptions& options, Recording* record,
                 const Recording* replay, const Console& console) {
  LoopSettings settings;
  settings.rate = options.rate, settings.frame_rate = options.frame_rate;
  const double dt = options.rate > 0 ? 1 / options.rate : scene.dt;
  const double begin = scene.motion.motion.times.front(), length = scene.motion.motion.times.back() - begin;
  settings.ticks = options.ticks ? options.ticks : static_cast<std::uint64_t>(length / dt) + 1;
  if (replay) settings.ticks = replay->ticks();
  settings.idle_ticks = std::min<std::uint64_t>(settings.ticks, 10000);
  std::error_code failure;
  std::filesystem::create_directories(options.output, failure);
  AtomicFile file(options.output / "summary.json");  // opened first: a wrong path is no news after the run
  State state = make_state(scene.model);
  LoopReport report;
  Comparison compared{replay};
  {
    const Progress progress = console.progress("loop");
    std::atomic<std::uint64_t> done{0};
    LoopHooks hooks;
    hooks.input = [&](std::uint64_t k, const State&, Input& input) {
      done.store(k, std::memory_order_relaxed);
      const double t = length > 0 ? std::fmod(static_cast<double>(k) * dt, 2 * length) : 0;
      set_input(scene.motion, begin + std::min(t, 2 * length - t), input);
      if (replay) replay->set_input(k, input);
      return !(progress.interrupted && progress.interrupted->load(std::memory_order_relaxed));
    };
    hooks.output = [&](std::uint64_t k, const Input& input, const State& s) {
      compared.see(k, s);
      if (record) record->add(input, s);
    };
    hooks.frame = [&](const Surface&) {
      if (progress.report)
        progress.report(static_cast<double>(done.load(std::memory_order_relaxed)) /
                        static_cast<double>(settings.ticks));
    };
    report = run_loop(scene.model, state, settings, hooks);
    if (progress.report) progress.report(1);
  }
  console.line(loop_table(report) + "  left in " + options.output.string());
  nlohmann::ordered_json summary{{"surface_nodes", scene.model.organ.surface_size()},
                                 {"rate_hz", options.rate},
                                 {"loop", nlohmann::ordered_json::parse(loop_json(report))}};
  file.write(summary.dump(2) + "\n");
  file.commit();
  console.object(nlohmann::json(summary));
  compared.require_same(options.replay);
}

}  // namespace

void run_simulate(const SimulateOptions& options, const Console& console) {
  const Timer timer = wall_timer();
  Scene scene = read_scene(options.scene, console.threads, console.progress("scene"));
  if (options.steps) scene.steps = options.steps;
  const Model& model = scene.model;
  stage_line(console, "scene",
             fmt::format("{} surface nodes, {} instrument(s), {} steps of {}", model.organ.surface_size(),
                         model.instruments.size(), scene.steps, human_time(scene.dt)),
             timer.seconds(), model.organ.compliance.bytes());
  Recording replay, record;
  if (!options.replay.empty()) {
    replay = Recording::read(options.replay);
    if (replay.organ() != model.organ.hash || replay.instruments() != model.instruments.size())
      throw Error(ErrorKind::usage,
                  "{}: recorded with another organ, or with {} instruments; the scene has {}",
                  options.replay.string(), replay.instruments(), model.instruments.size());
    scene.steps = replay.ticks();
  }
  if (!options.record.empty())
    record = Recording(model, options.loop && options.ticks ? options.ticks : scene.steps + 1);
  const auto finish = [&] {
    if (!options.record.empty())
      record.write(options.record, "palpate simulate " + options.scene.filename().string());
    if (!options.replay.empty())
      console.line(fmt::format("  replayed: {} ticks, the same states at all {} hashes", replay.ticks(),
                               replay.hashes() + 1));
  };
  if (options.loop) {
    run_in_loop(scene, options, options.record.empty() ? nullptr : &record,
                options.replay.empty() ? nullptr : &replay, console);
    return finish();
  }
  RunOptions run;
  if (!options.record.empty()) run.record = &record;
  if (!options.replay.empty()) run.replay = &replay, run.replayed_file = options.replay;
  run.folder = options.output;
  run.every = options.every;
  run.pictures = options.pictures;
  run.title = options.scene.filename().string();
  const RunSummary summary = run_scene(scene, run, console);
  console.line(summary_table(summary) + "  left in " + options.output.string());
  console.object(nlohmann::json::parse(summary_json(summary)));
  finish();
}

}  // namespace palpate
