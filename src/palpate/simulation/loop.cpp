#include "palpate/simulation/loop.hpp"

#include <fmt/core.h>
#include <pthread.h>
#include <sched.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <system_error>
#include <thread>

#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/base/triple_buffer.hpp"

namespace palpate {

namespace {

double now() noexcept {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void sleep_until(double time) noexcept {
  timespec t;
  t.tv_sec = static_cast<time_t>(time);
  t.tv_nsec = static_cast<long>((time - static_cast<double>(t.tv_sec)) * 1e9);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) == EINTR) {
  }
}

void stay_awake_until(double time) noexcept {
  while (now() < time) {
  }
}

// When ticks are due. A loop that has fallen behind by more than `most_behind` ticks starts its count anew:
// those between are left out, and missed.
class Pace {
 public:
  Pace(double rate, bool awake) noexcept : period_(rate > 0 ? 1 / rate : 0), awake_(awake), due_(now()) {}
  // Waits for the next tick to be due.
  void wait() noexcept {
    if (period_ == 0) {
      due_ = now();
      return;
    }
    due_ += period_;
    const double late = now() - due_;
    if (late > most_behind * period_)
      due_ += late, left_out_ += static_cast<std::uint64_t>(late / period_);
    else if (late < 0)
      awake_ ? stay_awake_until(due_) : sleep_until(due_);
  }
  void done(LoopTimes& times, double cpu) noexcept {
    const double wall = now() - due_;
    times.wall.add(wall);
    times.cpu.add(cpu);
    times.missed += std::exchange(left_out_, 0) + (period_ > 0 && wall > period_);
  }

 private:
  static constexpr double most_behind = 100;
  double period_;  // s
  bool awake_;
  double due_;  // s
  std::uint64_t left_out_ = 0;
};

bool go_first() noexcept {
  sched_param p{};
  p.sched_priority = 1;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &p) == 0;
}

// What the force loop hands over of a tick: an organ each.
struct Handed {
  std::uint64_t k = 0;
  std::vector<Loads> loads;
  std::vector<Outcome> outcomes;

  // With room for whatever comes of a tick of these states.
  explicit Handed(std::span<const State> states) {
    for (const State& s : states) {
      loads.push_back(s.loads);
      outcomes.push_back(s);
      outcomes.back().contacts.resize(s.contacts.capacity());  // a vector's copy has its size, not its room
    }
  }
  // Neither allocates nor throws, for that room.
  void take(std::size_t organ, const State& state) noexcept {
    loads[organ].copy(state.loads);
    outcomes[organ] = state;
  }
};

struct Shared {
  Shared(std::span<const State> states, const std::vector<Surface>& rest)
      : ticks(Handed(states)), surfaces(rest) {}
  TripleBuffer<Handed> ticks;                   // force loop to deformation
  TripleBuffer<std::vector<Surface>> surfaces;  // and back, an organ each
  std::atomic<bool> over{false};
};

// Says that the loop is over when it goes.
class EndOf {
 public:
  explicit EndOf(std::atomic<bool>& over) noexcept : over_(over) {}
  ~EndOf() { over_ = true; }
  EndOf(const EndOf&) = delete;
  EndOf& operator=(const EndOf&) = delete;

 private:
  std::atomic<bool>& over_;
};

void deform_until_over(std::span<const Model> models, const LoopSettings& settings, const OrgansHooks& hooks,
                       Shared& shared, std::span<Deformer> deformers, LoopReport& report) {
  // What a thread allocates when it asks a compliance for the first time: not in between.
  for (const Model& model : models) {
    const Index row = 0;
    std::array<float, 9> c;
    model.organ.compliance.block({&row, 1}, c, 3);
  }
  std::vector<Frame> frames;
  frames.reserve(models.size());
  double due = now();
  while (!shared.over.load(std::memory_order_relaxed)) {
    due = std::max(due + 1 / settings.frame_rate, now());
    sleep_until(due);
    if (!shared.ticks.fetch()) continue;
    const double begun = now();
    Handed& tick = shared.ticks.front();
    std::vector<Surface>& surfaces = shared.surfaces.back();
    for (std::size_t i = 0; i < models.size(); ++i)
      deform(models[i], tick.loads[i], deformers[i], surfaces[i], tick.outcomes[i]);
    if (hooks.frame) {
      frames.clear();
      for (std::size_t i = 0; i < models.size(); ++i)
        frames.push_back({tick.outcomes[i], surfaces[i], error_bar(models[i].organ, surfaces[i])});
      hooks.frame(tick.k, frames);
    }
    for (const Surface& surface : surfaces) {
      report.largest_strain = std::max(report.largest_strain, surface.strains.largest);
      report.beyond_linear += surface.strains.beyond_linear();
    }
    shared.surfaces.publish();
    report.surface.add(now() - begun);
    ++report.frames;
  }
}

void tick_until_over(std::span<const Model> models, std::span<State> states, const LoopSettings& settings,
                     const OrgansHooks& hooks, Shared& shared, std::span<Input> inputs,
                     LoopReport& report) noexcept {
  report.awake = settings.awake;
  report.first_in = settings.rate > 0 && !settings.awake && go_first();  // never one that does not sleep
  if (settings.idle_ticks > 0) {
    Pace pace(settings.rate, settings.awake);
    for (std::uint64_t k = 0; k < settings.idle_ticks; ++k) {
      pace.wait();
      const Timer cpu = thread_timer();
      pace.done(report.idle, cpu.seconds());
    }
  }
  const Timer wall = wall_timer();
  Pace pace(settings.rate, settings.awake);
  double in_contact = 0;
  for (std::uint64_t k = 0; settings.ticks == 0 || k < settings.ticks; ++k) {
    pace.wait();
    const Timer cpu = thread_timer();
    if (!hooks.input(k, states, inputs)) break;
    shared.surfaces.fetch();
    std::uint32_t status = status_ok;
    std::uint64_t contacts = 0;
    shared.ticks.back().k = k;
    for (std::size_t i = 0; i < models.size(); ++i) {
      tick(models[i], states[i], inputs[i], shared.surfaces.front()[i]);
      shared.ticks.back().take(i, states[i]);
      status |= states[i].status, contacts += states[i].contacts.size();
    }
    shared.ticks.publish();
    if (hooks.output) hooks.output(k, inputs, states);
    pace.done(report.ticks, cpu.seconds());
    report.not_converged += (status & not_converged) != 0;
    report.too_many_contacts += (status & too_many_contacts) != 0;
    report.bad_input += (status & bad_input) != 0;
    report.anchor_touched += (status & anchor_touched) != 0;
    report.jumped += (status & jumped) != 0;
    report.contacts_max = std::max(report.contacts_max, contacts);
    for (std::size_t i = 0; !states.empty() && i < states[0].wrenches.size(); ++i)
      report.peak_force = std::max(report.peak_force, wrench_of(states, i).force.norm());
    if (contacts > 0) report.contacts_mean += static_cast<double>(contacts), ++in_contact;
  }
  report.seconds = wall.seconds();
  if (in_contact > 0) report.contacts_mean /= in_contact;
  shared.over = true;
}

constexpr char no_input[] = "a loop without input(): say what each tick begins with";

}  // namespace

LoopReport run_loop(const Model& model, State& state, const LoopSettings& settings, const LoopHooks& hooks) {
  if (!hooks.input) throw Error(ErrorKind::usage, no_input);
  OrgansHooks all;
  all.input = [&](std::uint64_t k, std::span<const State> states, std::span<Input> inputs) {
    return hooks.input(k, states[0], inputs[0]);
  };
  if (hooks.output)
    all.output = [&](std::uint64_t k, std::span<const Input> inputs, std::span<const State> states) {
      hooks.output(k, inputs[0], states[0]);
    };
  if (hooks.frame)
    all.frame = [&](std::uint64_t k, std::span<const Frame> frames) { hooks.frame(k, frames[0]); };
  return run_loop(std::span(&model, 1), std::span(&state, 1), settings, all);
}

LoopReport run_loop(std::span<const Model> models, std::span<State> states, const LoopSettings& settings,
                    const OrgansHooks& hooks) {
  if (!(settings.rate == 0 || (settings.rate >= 1 && settings.rate <= 4000)))
    throw Error(ErrorKind::usage, "a loop of {} ticks a second; use 1 to 4000, or 0 for as fast as they go",
                settings.rate);
  if (!hooks.input) throw Error(ErrorKind::usage, no_input);
  if (!(settings.frame_rate >= 1 && settings.frame_rate <= 1000))
    throw Error(ErrorKind::usage, "{} surfaces a second; use 1 to 1000", settings.frame_rate);
  std::vector<Surface> rest;
  std::vector<Deformer> deformers;
  for (std::size_t i = 0; i < models.size(); ++i) {
    if (models[i].settings.mode == Mode::imprint)
      throw Error(ErrorKind::usage, "mode imprint changes the surface itself, which in a loop lags behind");
    rest.push_back(states[i].surface);
    deformers.emplace_back(models[i].organ);
  }
  Shared shared(states, rest);
  std::vector<Input> inputs = make_inputs(models);
  LoopReport report;
  try {
    std::jthread deformation([&] { deform_until_over(models, settings, hooks, shared, deformers, report); });
    const EndOf end(shared.over);  // also where the other does not start
    std::jthread([&] { tick_until_over(models, states, settings, hooks, shared, inputs, report); }).join();
  } catch (const std::system_error& e) {
    throw Error(ErrorKind::resource, "the loop's two threads do not start: {}", e.what());
  }
  for (std::size_t i = 0; i < models.size(); ++i)
    deform(models[i], states[i].loads, deformers[i], states[i].surface, states[i]);
  return report;
}

namespace {

// Times by factors of two: the histograms side by side.
std::string histogram_table(const LoopReport& r) {
  std::map<int, std::array<std::uint64_t, 3>> rows;
  const std::array columns{&r.ticks.cpu, &r.ticks.wall, &r.idle.wall};
  for (std::size_t c = 0; c < columns.size(); ++c)
    columns[c]->each_bin([&](double end, std::uint64_t count) {
      rows[static_cast<int>(std::ceil(std::log2(end / Histogram::smallest) - 1e-6))][c] += count;
    });
  std::string out =
      fmt::format("  {:<28} {:>12} {:>12} {:>12}\n", "ticks of up to", "CPU time", "due to done", "empty");
  for (const auto& [octave, counts] : rows)
    out += fmt::format("  {:>22.3g} ms    {:>12} {:>12} {:>12}\n",
                       1e3 * Histogram::smallest * std::exp2(octave), counts[0], counts[1], counts[2]);
  return out;
}

}  // namespace

std::string loop_table(const LoopReport& r) {
  const auto row = [](const char* label, const Histogram& h, const std::string& more) {
    return fmt::format("  {:<28} {:8.3f} {:8.3f} {:8.3f} {:8.3f} ms{}\n", label, 1e3 * h.percentile(0.5),
                       1e3 * h.percentile(0.99), 1e3 * h.percentile(0.999), 1e3 * h.worst(), more);
  };
  std::string out = fmt::format("  {:<28} {:>8} {:>8} {:>8} {:>8}\n", "", "p50", "p99", "p99.9", "worst");
  out += row("tick, CPU time", r.ticks.cpu, "");
  out += row(
      "tick, due to done", r.ticks.wall,
      fmt::format("   {} after the next was due or left out, {} run", r.ticks.missed, r.ticks.wall.count()));
  if (r.idle.wall.count() > 0) {
    out += row("empty tick, CPU time", r.idle.cpu, "");
    out += row("empty tick, due to done", r.idle.wall,
               fmt::format("   {}, {} run: the machine's own", r.idle.missed, r.idle.wall.count()));
  }
  if (r.frames > 0)
    out += row("surface", r.surface,
               fmt::format("   {:.0f} a second", static_cast<double>(r.frames) / r.seconds));
  out += fmt::format("  {:<28} {:.0f} / {}\n", "contacts, mean / most", r.contacts_mean, r.contacts_max);
  out += fmt::format("  {:<28} {:.3f} N\n", "peak force", r.peak_force);
  out += fmt::format("  {:<28} {} of {}\n", "ticks not converged", r.not_converged, r.ticks.wall.count());
  out += fmt::format("  {:<28} {}\n", "precedence of the force loop",
                     r.awake      ? "none: it stays awake"
                     : r.first_in ? "SCHED_FIFO"
                                  : "none (not permitted)");
  return out + histogram_table(r);
}

std::string loop_json(const LoopReport& r) {
  const auto times = [](const Histogram& h) {
    return nlohmann::ordered_json{{"p50_ms", 1e3 * h.percentile(0.5)},
                                  {"p99_ms", 1e3 * h.percentile(0.99)},
                                  {"p99.9_ms", 1e3 * h.percentile(0.999)},
                                  {"worst_ms", 1e3 * h.worst()},
                                  {"mean_ms", 1e3 * h.mean()},
                                  {"count", h.count()}};
  };
  const auto bins = [](const Histogram& h) {
    nlohmann::ordered_json up_to = nlohmann::json::array(), count = up_to;
    h.each_bin([&](double end, std::uint64_t n) { up_to.push_back(1e3 * end), count.push_back(n); });
    return nlohmann::ordered_json{{"up_to_ms", up_to}, {"count", count}};
  };
  return nlohmann::ordered_json{{"tick_cpu", times(r.ticks.cpu)},
                                {"tick_wall", times(r.ticks.wall)},
                                {"missed", r.ticks.missed},
                                {"empty_tick_cpu", times(r.idle.cpu)},
                                {"empty_tick_wall", times(r.idle.wall)},
                                {"empty_missed", r.idle.missed},
                                {"surface", times(r.surface)},
                                {"frames", r.frames},
                                {"seconds", r.seconds},
                                {"contacts_mean", r.contacts_mean},
                                {"contacts_max", r.contacts_max},
                                {"peak_force_N", r.peak_force},
                                {"not_converged", r.not_converged},
                                {"too_many_contacts", r.too_many_contacts},
                                {"bad_input", r.bad_input},
                                {"anchor_touched", r.anchor_touched},
                                {"jumped", r.jumped},
                                {"largest_strain", r.largest_strain},
                                {"frames_beyond_linear", r.beyond_linear},
                                {"awake", r.awake},
                                {"sched_fifo", r.first_in},
                                {"histograms",
                                 {{"tick_cpu", bins(r.ticks.cpu)},
                                  {"tick_wall", bins(r.ticks.wall)},
                                  {"empty_tick_cpu", bins(r.idle.cpu)},
                                  {"empty_tick_wall", bins(r.idle.wall)}}}}
      .dump(2);
}

}  // namespace palpate
