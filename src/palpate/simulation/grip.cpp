// What instruments hold: nodes that were under pressure when the grip closed go with the instrument, and may
// pull at it, until it opens.
#include <algorithm>
#include <utility>

#include "palpate/simulation/tick_work.hpp"

namespace palpate {

namespace {

bool grips(const Input& input, Index instrument) {
  return !input.grips.empty() && input.grips[at(instrument)] != 0;
}

}  // namespace

void let_go(const Model& model, State& state, const Input& input) {
  StepScratch& w = *state.scratch;
  const auto row_of = [&](const Grasp& g) { return at(model.organ.row_of[at(g.node)]); };
  std::erase_if(state.grasps, [&](const Grasp& g) {
    if (g.node < 0 || at(g.node) >= model.organ.surface_size() || model.organ.row_of[at(g.node)] < 0 ||
        g.instrument < 0 || at(g.instrument) >= w.shapes.size() || !g.place.allFinite())
      return true;
    const Sweep& sweep = w.sweeps[at(g.instrument)];
    const Vec3 way = w.shapes[at(g.instrument)].to_organ * g.place - sweep.last.inverse() * g.place;
    return !grips(input, g.instrument) || !sweep.known || way.norm() > largest_motion * w.size ||
           std::exchange(w.is_wanted[row_of(g)], 1) != 0;  // held already
  });
  for (const Grasp& g : state.grasps) w.is_wanted[row_of(g)] = 0;
}

void grasp(const Model& model, State& state, const Input& input) {
  StepScratch& w = *state.scratch;
  const auto held = static_cast<std::ptrdiff_t>(state.grasps.size());
  std::size_t points = 2 * w.places + state.contacts.size() + 2 * state.grasps.size();
  for (const Contact& c : state.contacts) {
    const auto same = [&](const Grasp& g) { return g.instrument == c.instrument; };
    if (!grips(input, c.instrument) || std::any_of(state.grasps.begin(), state.grasps.begin() + held, same))
      continue;
    const Triangle node{c.node, c.node, c.node};
    for (const Index n : c.triangle < 0 ? node : model.organ.surface.triangles[at(c.triangle)]) {
      if (w.grasped[at(n)] || model.organ.row_of[at(n)] < 0) continue;
      if (points + (c.triangle < 0 ? 2 : 3) > w.capacity) {
        state.status |= too_many_contacts;
        return;
      }
      points += c.triangle < 0 ? 2 : 3;
      const Vec3 now = model.organ.contact_points[at(n)] + displacement(model, state, n);
      state.grasps.push_back({n, c.instrument, w.shapes[at(c.instrument)].to_shape * now});
      w.grasped[at(n)] = 1;
    }
  }
}

}  // namespace palpate
