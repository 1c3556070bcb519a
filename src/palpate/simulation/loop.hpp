// The force loop: ticks at a set rate in a thread of their own, the whole surface in another, at its own
// rate.
//
//              outcome, loads (newest)                surface (newest)
//   force loop ---------------------> deformation ---------------------> force loop, for its next detection
//    tick k                            u = C f
//                                         |
//                                         +---> frame(): a viewer, a recorder. Surface, contacts, wrenches,
//                                               poses, error bars: all of tick k
//
// What came of a tick goes with its loads, so that no frame shows two moments. Both arrows are triple buffers
// (base/triple_buffer.hpp): one atomic exchange hands over, nobody waits, values in between are lost. A tick
// reads the newest surface there is, of whatever earlier tick; its forces do not depend on which (step.cpp),
// so a loop gives the same bits as the same inputs step by step. Between its first and its last tick the
// force loop allocates nothing, takes no lock and throws nothing. What a tick may cost is bounded by Settings
// in contacts and iterations, never by a clock: a tick that is late is late, and counted.
#pragma once

#include <functional>

#include "palpate/base/histogram.hpp"
#include "palpate/simulation/frame.hpp"

namespace palpate {

struct LoopSettings {
  double rate = 1000;  // ticks a second: 1 to 4,000; 0: as fast as they go
  // Surfaces a second at most. The older a surface, the more nodes a tick has to look after: at twice the
  // rate of a display the slowest ticks take a seventh less.
  double frame_rate = 120;
  // Looks at the clock until a tick is due, instead of sleeping: caches stay warm and the processor at its
  // clock, and no tick waits to be woken. Takes a core of its own, which other threads have to do without.
  bool awake = false;
  std::uint64_t ticks = 0;  // 0: until input() says so
  std::uint64_t idle_ticks =
      0;  // before: the same loop with nothing in it, to see what the machine does by itself
};

// Called from the loop's threads; must not throw. input and output may not wait, allocate or lock either.
struct LoopHooks {
  // Force thread: what tick number k begins with; `state` is the tick's before. False: stop, before tick k.
  std::function<bool(std::uint64_t k, const State& state, Input& input)> input;
  // Force thread: what came out, but for what deform() adds. May be empty.
  std::function<void(std::uint64_t k, const Input& input, const State& state)> output;
  // Deformation thread: a new surface and what came of tick k, whose loads it is under; valid during the
  // call. May be empty.
  std::function<void(std::uint64_t k, const Frame& frame)> frame;
};
// The same with several organs (organs.hpp): one of each an organ. The frames are all of the same tick.
struct OrgansHooks {
  std::function<bool(std::uint64_t k, std::span<const State> states, std::span<Input> inputs)> input;
  std::function<void(std::uint64_t k, std::span<const Input> inputs, std::span<const State> states)> output;
  std::function<void(std::uint64_t k, std::span<const Frame> frames)> frame;
};

struct LoopTimes {
  Histogram wall;  // s, from when the tick was due to its end: what a device sees
  Histogram cpu;   // s, CPU time of its thread
  // Ticks that ended after the next was due, and those left out where the loop was more than 100 behind,
  // which are in no histogram.
  std::uint64_t missed = 0;
};
struct LoopReport {
  LoopTimes ticks, idle;
  std::uint64_t frames = 0, contacts_max = 0;  // the latter: in a tick, of all organs
  // Ticks with such a status, of any organ.
  std::uint64_t not_converged = 0, too_many_contacts = 0, bad_input = 0, anchor_touched = 0, jumped = 0;
  double peak_force = 0;            // N, on an instrument, of all organs together
  double largest_strain = 0;        // of the surfaces made
  std::uint64_t beyond_linear = 0;  // surfaces strained by more than linear_strain
  double contacts_mean = 0;
  double seconds = 0;     // wall, of the ticks
  Histogram surface;      // s, wall, of making one and of the frame() that takes it
  bool awake = false;     // as LoopSettings
  bool first_in = false;  // the system granted the force thread precedence (SCHED_FIFO); not asked if awake
};

// Blocks until the loop ends. state: from make_state, and left as after the last step: with its surface.
// Throws Error(usage) for a rate out of range, without input(), or for Mode::imprint, whose surface cannot
// lag behind; Error(resource) where the system has no two threads to give.
LoopReport run_loop(const Model& model, State& state, const LoopSettings& settings, const LoopHooks& hooks);
// Several organs, one after another in each tick. states: from make_states.
LoopReport run_loop(std::span<const Model> models, std::span<State> states, const LoopSettings& settings,
                    const OrgansHooks& hooks);

// "p50 0.112  p99 0.203 ..." and the histograms as lines, in ms; and as an object for summaries.
std::string loop_table(const LoopReport& report);
std::string loop_json(const LoopReport& report);

}  // namespace palpate
