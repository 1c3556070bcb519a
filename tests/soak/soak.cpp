// Not a test of ./test: ./test soak [SECONDS] [--seed N]. Random scenes, motions and faults until the time is
// over. Each case follows from its seed alone; `--seed N` runs case N again, and says more.
#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "palpate/base/timer.hpp"
#include "palpate/compliance/blas.hpp"
#include "palpate/simulation/loop.hpp"
#include "palpate/simulation/recording.hpp"
#include "soak/driver.hpp"

namespace palpate::soak {
namespace {

volatile std::sig_atomic_t case_now = 0;  // its seed, for the message of a crash

extern "C" void stopped(int signal) {
  const std::string text = fmt::format("seed {}: signal {} ({})\n", static_cast<long>(case_now), signal,
                                       signal == SIGALRM ? "hangs" : "crash");
  [[maybe_unused]] const auto ignored = write(2, text.data(), text.size());
  _exit(1);
}

// What the whole run has met, to see that it meets everything.
struct Tally {
  std::uint64_t cases = 0, ticks = 0, loops = 0, bad_inputs = 0, touching = 0, not_converged = 0, full = 0;
  std::uint64_t lost = 0;      // ticks without a device
  std::uint64_t grasping = 0;  // ticks that hold nodes
  void count(const Driver& driver) {
    ++cases, ticks += driver.ticks(), bad_inputs += driver.met().bad_inputs,
        touching += driver.met().touching;
    not_converged += driver.met().not_converged, full += driver.met().full, lost += driver.met().lost,
        grasping += driver.met().grasping;
  }
};

std::uint64_t run_stepwise(std::span<const Model> models, Driver& driver) {
  std::vector<State> states = make_states(models);
  std::vector<Input> inputs = make_inputs(models);
  for (std::uint64_t k = 0; driver.lead(k, states, inputs); ++k) {
    step(models, states, inputs);
    driver.check(k, states);
    for (const State& state : states) driver.check_surface(state.surface);
  }
  return state_hash(std::span<const State>(states));
}

std::uint64_t run_threaded(std::span<const Model> models, Driver& driver) {
  std::vector<State> states = make_states(models);
  OrgansHooks hooks;
  hooks.input = [&](std::uint64_t k, std::span<const State> s, std::span<Input> inputs) {
    return driver.lead(k, s, inputs);
  };
  hooks.output = [&](std::uint64_t k, std::span<const Input>, std::span<const State> s) {
    driver.check(k, s);
  };
  hooks.frame = [&](std::uint64_t, std::span<const Frame> frames) {
    for (const Frame& frame : frames) driver.check_surface(frame.surface);
  };
  LoopSettings settings;
  settings.rate = 0, settings.frame_rate = 500;
  run_loop(models, states, settings, hooks);
  return state_hash(std::span<const State>(states));
}

// Returns what is wrong; empty: nothing.
std::string run_case(const std::vector<Organ>& organs, std::uint64_t seed, Tally& tally, bool verbose) {
  Random random(seed);
  const std::vector<Model> models = random_models(organs, random);
  const Model& model = models[0];
  const bool coupled = model.settings.mode != Mode::imprint && random.once_in(3);
  const bool threads = model.settings.mode != Mode::imprint && random.once_in(2);
  const std::uint64_t ticks = 100 + random.below(700), way = seed ^ 0x9e3779b97f4a7c15u;
  if (verbose)
    fmt::print(
        "{} organ(s), the first of {} surface nodes, {}, {} instrument(s), mode {}, friction {:.2f}, {} "
        "contacts, {}{}{} ticks\n",
        models.size(), model.organ.surface_size(), model.organ.compliance.storage(), model.instruments.size(),
        name(model.settings.mode), model.settings.friction, model.settings.max_contacts,
        coupled ? "device, " : "", threads ? "threads, " : "", ticks);
  Driver driver(models, way, ticks, coupled);
  const std::uint64_t hash = threads ? run_threaded(models, driver) : run_stepwise(models, driver);
  tally.count(driver);
  if (!driver.complaint().empty() || !threads) return driver.complaint();
  ++tally.loops;
  Driver again(models, way, ticks, coupled);
  if (run_stepwise(models, again) != hash) return "the loop's last state is another than step by step";
  return again.complaint();
}

// Resident after each case, once it has been freed.
struct Memory {
  std::vector<std::pair<double, double>> samples;  // s, MB
  void add(double time) {
    malloc_trim(0);
    samples.emplace_back(time, static_cast<double>(resident_bytes()) * 1e-6);
  }
  double mean(double from, double to) const {
    double sum = 0, n = 0;
    for (const auto& [t, mb] : samples)
      if (t >= from && t < to) sum += mb, ++n;
    return n > 0 ? sum / n : 0;
  }
};

int soak(double seconds, std::uint64_t first, bool one) {
  const std::vector<Organ> organs = make_organs();
  Tally tally;
  Memory memory;
  const Timer timer = wall_timer();
  for (std::uint64_t seed = first; one ? seed == first : timer.seconds() < seconds; ++seed) {
    case_now = static_cast<std::sig_atomic_t>(seed);
    alarm(300);
    const std::string complaint = run_case(organs, seed, tally, one);
    alarm(0);
    if (!complaint.empty()) {
      fmt::print(stderr, "seed {}: {}\nagain: ./test soak --seed {}\n", seed, complaint, seed);
      return 1;
    }
    memory.add(timer.seconds());
  }
  fmt::print(
      "{} cases, {} of them with threads too; {} ticks, {} touching, {} not converged, {} with too many "
      "contacts, {} of bad input, {} without their device, {} with a grip\n",
      tally.cases, tally.loops, tally.ticks, tally.touching, tally.not_converged, tally.full,
      tally.bad_inputs, tally.lost, tally.grasping);
  if (one) return 0;
  const double early = memory.mean(seconds / 4, seconds / 2),
               late = memory.mean(3 * seconds / 4, 2 * seconds);
  fmt::print("resident: {:.1f} MB in the second quarter, {:.1f} in the last\n", early, late);
#ifndef __SANITIZE_ADDRESS__  // which keeps what is freed for a while
  if (late > early + 2) {
    fmt::print(stderr, "memory grows\n");
    return 1;
  }
#endif
  return 0;
}

}  // namespace
}  // namespace palpate::soak

int main(int argc, char** argv) {
  palpate::set_up_blas();
  double seconds = 600;
  std::uint64_t seed = 1;
  bool one = false;
  for (int i = 1; i < argc; ++i)
    if (!std::strcmp(argv[i], "--seed") && i + 1 < argc)
      seed = std::strtoull(argv[++i], nullptr, 10), one = true;
    else
      seconds = std::atof(argv[i]);
  for (const int signal : {SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGALRM})
    std::signal(signal, palpate::soak::stopped);
  return palpate::soak::soak(seconds, seed, one);
}
