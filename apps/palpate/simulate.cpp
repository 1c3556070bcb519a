#include <fmt/core.h>

#include <atomic>
#include <cmath>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/haptics/coupling.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/simulation/loop.hpp"
#include "run.hpp"

namespace palpate {

namespace {

// A haptic device, the coupling to the first instrument, and what the hand felt.
struct Hand {
  std::unique_ptr<HapticDevice> device;
  CouplingSettings settings;
  CouplingState coupling;
  Vec3 at = Vec3::Zero();  // where the device's frame stands, m
  double peak = 0;         // N
  std::uint64_t connected = 0;

  void lead(std::span<Input> inputs, std::span<const State> states, double dt) noexcept {
    DeviceSample sample = device->read();
    sample.pose.translation += at;
    connected += sample.connected;
    place(inputs, 0, couple(settings, coupling, sample, wrench_of(states, 0), dt, is_taken(states)));
    grip(inputs, 0, sample.buttons != 0);
  }
  void feel(std::span<const State> states) noexcept {
    const Wrench wrench = hand_wrench(settings, coupling, wrench_of(states, 0));
    peak = std::max(peak, wrench.force.norm());
    device->write(wrench);
  }
};

std::size_t surface_nodes(const Scene& scene) {
  std::size_t sum = 0;
  for (const Model& m : scene.models) sum += m.organ.surface_size();
  return sum;
}

double tick_of(const Scene& scene, const SimulateOptions& options) {
  return options.rate > 0 ? 1 / options.rate : scene.dt;
}

// How many ticks there will be, in a loop or step by step.
std::uint64_t ticks_of(const Scene& scene, const SimulateOptions& options, const Recording* replay) {
  if (replay) return replay->ticks();
  if (!options.loop) return scene.steps;
  if (options.ticks) return options.ticks;
  const std::vector<double>& times = scene.motion.motion.times;
  return static_cast<std::uint64_t>((times.back() - times.front()) / tick_of(scene, options) + 1e-6) + 1;
}

Hand open_hand(const Scene& scene, const SimulateOptions& options) {
  Hand hand;
  hand.device = open_device(options.device);
  if (!options.device_at.empty())
    hand.at = Vec3(options.device_at[0], options.device_at[1], options.device_at[2]);
  std::vector<Input> first = make_inputs(scene.models);  // until the device is heard of
  set_inputs(scene.motion, scene.motion.motion.times.front(), first);
  hand.coupling.instrument =
      scene.motion.moved[0] ? first[0].instruments[0] : clear_of(scene.models, first, 0);
  return hand;
}

// The scene's motion to and fro in real time.
void run_in_loop(const Scene& scene, const SimulateOptions& options, Recording* record,
                 const Recording* replay, const Console& console) {
  LoopSettings settings;
  settings.rate = options.rate, settings.frame_rate = options.frame_rate, settings.awake = options.awake;
  const double dt = tick_of(scene, options);
  const double begin = scene.motion.motion.times.front(), length = scene.motion.motion.times.back() - begin;
  settings.ticks = ticks_of(scene, options, replay);
  settings.idle_ticks =
      std::min(settings.ticks, std::clamp<std::uint64_t>(settings.ticks / 10, 10000, 100000));
  std::error_code failure;
  std::filesystem::create_directories(options.output, failure);
  AtomicFile file(options.output / "summary.json");  // opened first: a wrong path is no news after the run
  std::vector<State> states = make_states(scene.models);
  LoopReport report;
  ForceTable forces(scene.models, scene.organs);
  Comparison compared{replay};
  Hand hand;
  if (!options.device.empty()) {
    if (options.rate == 0 || replay)
      throw Error(ErrorKind::usage, "--device {}: not with --replay or --rate 0", options.device);
    hand = open_hand(scene, options);
  }
  {
    const Progress progress = console.progress("loop");
    std::atomic<std::uint64_t> done{0};
    OrgansHooks hooks;
    hooks.input = [&](std::uint64_t k, std::span<const State> now, std::span<Input> inputs) {
      done.store(k, std::memory_order_relaxed);
      const double t = length > 0 ? std::fmod(static_cast<double>(k) * dt, 2 * length) : 0;
      set_inputs(scene.motion, begin + std::min(t, 2 * length - t), inputs);
      if (replay) replay->set_inputs(k, inputs);
      if (hand.device) hand.lead(inputs, now, dt);
      return !(progress.interrupted && progress.interrupted->load(std::memory_order_relaxed));
    };
    hooks.output = [&](std::uint64_t k, std::span<const Input> inputs, std::span<const State> now) {
      if (hand.device) hand.feel(now);
      compared.see(k, now);
      if (record) record->add(inputs, now);
    };
    hooks.frame = [&](std::uint64_t k, std::span<const Frame> frames) {
      forces.add(k, frames);
      if (progress.report)
        progress.report(static_cast<double>(done.load(std::memory_order_relaxed)) /
                        static_cast<double>(settings.ticks));
    };
    report = run_loop(scene.models, states, settings, hooks);
    if (progress.report) progress.report(1);
  }
  forces.write(options.output / "forces.csv");
  console.line(loop_table(report) + "  left in " + options.output.string());
  if (hand.device)
    console.line(fmt::format("  hand: {} connected in {} of {} ticks, felt up to {:.3g} N", options.device,
                             hand.connected, report.ticks.wall.count(), hand.peak));
  nlohmann::ordered_json summary{{"surface_nodes", surface_nodes(scene)},
                                 {"rate_hz", options.rate},
                                 {"loop", nlohmann::ordered_json::parse(loop_json(report))}};
  if (hand.device)
    summary["device"] = {
        {"name", options.device}, {"ticks_connected", hand.connected}, {"peak_force_N", hand.peak}};
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
  std::size_t bytes = 0;
  for (const Model& m : scene.models) bytes += m.organ.compliance.bytes();
  const std::size_t instruments = scene.models[0].instruments.size();
  stage_line(console, "scene",
             fmt::format("{} surface nodes{}, {} instrument(s), {} steps of {}", surface_nodes(scene),
                         scene.models.size() > 1 ? fmt::format(" of {} organs", scene.models.size()) : "",
                         instruments, scene.steps, human_time(scene.dt)),
             timer.seconds(), bytes);
  for (const std::string& text : advice(scene)) console.line("note        " + text);
  Recording replay, record;
  if (!options.replay.empty()) {
    replay = Recording::read(options.replay);
    if (!replay.made_with(scene.models))
      throw Error(ErrorKind::usage,
                  "{}: recorded with other organs than the scene's, or of another number: it has {} organ(s) "
                  "and {} instrument(s), the scene {} and {}",
                  options.replay.string(), replay.organs(), replay.instruments(), scene.models.size(),
                  instruments);
    scene.steps = replay.ticks();
  }
  if (!options.record.empty())
    record = Recording(scene.models, ticks_of(scene, options, options.replay.empty() ? nullptr : &replay));
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
