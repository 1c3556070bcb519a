// What is seen of an organ at one moment, whoever looks: a viewer at the force loop, a recorder step by step.
#pragma once

#include "palpate/simulation/error_bars.hpp"
#include "palpate/simulation/organs.hpp"

namespace palpate {

// A view: valid as long as what it shows, in the force loop during frame().
struct Frame {
  const Outcome& outcome;  // of the tick whose loads the surface is under; its status knows the strains, too
  const Surface& surface;
  ErrorBar bar;  // of the resultant of the loads

  operator const Outcome&() const noexcept { return outcome; }
};

// After step().
inline Frame frame_of(const Model& model, const State& state) noexcept {
  return {state, state.surface, error_bar(model.organ, state.surface)};
}
std::vector<Frame> frames_of(std::span<const Model> models, std::span<const State> states);

// Of one of the frame's contacts: linearity is that of its nodes, the rest that of the resultant. It is meant
// for the pressure around the contact, not for its share of it.
ErrorBar error_bar(const Organ& organ, const Frame& frame, const Contact& contact) noexcept;
// Of several organs: the one with the largest total.
ErrorBar largest_bar(std::span<const Frame> frames) noexcept;

}  // namespace palpate
