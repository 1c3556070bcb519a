// Several organs under the same instruments: for each of them a Model with those instruments, a State and an
// Input with the instruments' poses. Organs do not feel each other, and poses are given, not solved for; so
// each organ is a simulation of its own, to the bit, and only what an instrument feels is a sum.
#pragma once

#include <span>
#include <vector>

#include "palpate/simulation/model.hpp"

namespace palpate {

// A state an organ. Throws Error(usage) where there is no organ or the instruments are not the same in all
// (names in their order), and what make_state throws.
std::vector<State> make_states(std::span<const Model> models);
// An input an organ, everything at the origin, no grip closed.
std::vector<Input> make_inputs(std::span<const Model> models);

// A pose for an instrument that is not there yet: far from all organs where the inputs have them, whatever
// its shape.
Pose clear_of(std::span<const Model> models, std::span<const Input> inputs, std::size_t instrument) noexcept;

// Puts an instrument to a pose, in the world, for all organs.
inline void place(std::span<Input> inputs, std::size_t instrument, const Pose& pose) noexcept {
  for (Input& input : inputs) input.instruments[instrument] = pose;
}
// Closes or opens an instrument's grip, for all organs: it may hold nodes of several.
inline void grip(std::span<Input> inputs, std::size_t instrument, bool closed) noexcept {
  for (Input& input : inputs) input.grips[instrument] = closed;
}
// A tick of each organ, and its surface. Never throws, allocates or locks.
inline void step(std::span<const Model> models, std::span<State> states,
                 std::span<const Input> inputs) noexcept {
  for (std::size_t i = 0; i < models.size(); ++i) step(models[i], states[i], inputs[i]);
}
// Whether the last tick took its input, of each organ: no status bad_input, which keeps the wrenches of a
// tick before.
template <class Outcomes>
bool is_taken(const Outcomes& organs) noexcept {
  for (const Outcome& organ : organs)
    if (organ.status & bad_input) return false;
  return true;
}
// What an instrument feels of all organs; of their states, or of their frames (frame.hpp).
template <class Outcomes>
Wrench wrench_of(const Outcomes& organs, std::size_t instrument) noexcept {
  Wrench sum;
  for (const Outcome& organ : organs) {
    sum.force += organ.wrenches[instrument].force;
    sum.torque += organ.wrenches[instrument].torque;
  }
  return sum;
}

// How many nodes it holds in this tick.
template <class Outcomes>
std::size_t grasped_by(const Outcomes& organs, std::size_t instrument) noexcept {
  std::size_t sum = 0;
  for (const Outcome& organ : organs)
    for (const Contact& c : organ.contacts)
      sum += c.grasped && c.instrument == static_cast<Index>(instrument);
  return sum;
}

}  // namespace palpate
