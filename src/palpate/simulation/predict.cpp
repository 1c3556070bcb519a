// What a tick begins with. Between two ticks of a hand's motion forces change nearly as they did between the
// last two, in the proportion of the ways: the solver then has to find the change of the change, a tenth or
// less of what it would have to find from the last tick's forces.
#include <utility>

#include "palpate/simulation/tick_work.hpp"

namespace palpate {

namespace {

bool is_point(const Model& model, const StepScratch& w, Index node) {
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    if (w.point_of[i * model.organ.surface_size() + at(node)] >= 0) return true;
  return false;
}

}  // namespace

bool foreseeable(const Model& model, const State& state) {
  return model.settings.friction == 0 && state.grasps.empty() && state.scratch->faces.empty();
}

bool predict(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  const bool known = w.ahead != 0 && w.earlier.u_known && state.loads.number == w.before.number;
  for (std::size_t k = 0; k < w.earlier.count; ++k)
    w.earlier_of[at(w.earlier.rows[k])] = static_cast<Index>(k);
  for (ContactPoint& c : w.points) {
    // Of a place the triangle's nodes had the forces, of a node of two instruments both.
    if (c.triangle >= 0 || c.grasped) continue;
    StepScratch::Begun& own = w.begun[at(c.node)];
    const StepScratch::Begun begun = std::exchange(own, {c.u, w.ticks, own.corrected});
    if (!known || !is_alone(model, w, c)) continue;
    if (begun.tick + 1 == w.ticks) c.foreseen_u = w.ahead * (c.u - begun.u);
    if (c.force == Vec3::Zero()) continue;
    const Index k = w.earlier_of[at(c.row)];
    c.foreseen = w.ahead * (k < 0 ? c.force : Vec3(c.force - w.earlier.forces[at(k)]));
  }
  for (std::size_t k = 0; k < w.earlier.count; ++k) w.earlier_of[at(w.earlier.rows[k])] = -1;
  return known;
}

// While a motion goes on displacements change as the forces do, so what the foreseen forces do needs no
// product with all of C. That goes for the change of all loads together, in proportion: a point of which no
// change is known asks for its row, and what of the loads is foreseen of no point (which let go, or is of two
// instruments) is taken away again. Errors of a product go on with the motion, so they are few: corrections
// of a smooth one are small.
bool foresee(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  if (!foreseeable(model, state) || !w.travel.smooth || !w.loaded.loadable || !w.loaded_earlier.loadable)
    return false;
  const auto put = [&](std::vector<float>& planes, Index slot, const Vec3& v) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      planes[axis * w.block.plane() + at(slot)] = static_cast<float>(v[static_cast<int>(axis)]);
  };
  w.block.spread({}, {}, w.foreseen), w.block.spread({}, {}, w.foreseen_moved);
  for (std::size_t k = 0; k < w.earlier.count; ++k)
    w.earlier_of[at(w.earlier.rows[k])] = static_cast<Index>(k);
  for (std::size_t k = 0; k < state.loads.count; ++k) {  // differences of float64, as they are small
    const Index before = std::exchange(w.earlier_of[at(state.loads.rows[k])], -1);
    const Vec3 force = before < 0 ? Vec3(Vec3::Zero()) : w.earlier.forces[at(before)];
    put(w.foreseen, w.block.slot_of(state.loads.rows[k]), w.ahead * (state.loads.forces[k] - force));
  }
  for (std::size_t k = 0; k < w.earlier.count; ++k)
    if (std::exchange(w.earlier_of[at(w.earlier.rows[k])], -1) >= 0)
      put(w.foreseen, w.block.slot_of(w.earlier.rows[k]), -w.ahead * w.earlier.forces[k]);
  // More rows cost what a product with half of C does.
  const std::size_t most_asked = 16 + w.points.size() / 4;
  std::size_t asked = 0;
  const auto ask = [&](Index slot) {
    return ++asked <= most_asked ? w.block.displacement(slot, w.foreseen) : Vec3(Vec3::Zero());
  };
  for (const ContactPoint& c : w.points) {
    const bool known = c.foreseen_u != Vec3::Zero() && w.begun[at(c.node)].corrected + 1 != w.ticks;
    put(w.foreseen_moved, c.slot, known ? c.foreseen_u : ask(c.slot));
  }
  for (std::size_t k = 0; k < w.earlier.count; ++k) {  // travel() asks where these have gone, too
    const Index row = w.earlier.rows[k], slot = w.block.slot_of(row);
    if (!is_point(model, w, model.organ.node_of_row[at(row)])) put(w.foreseen_moved, slot, ask(slot));
  }
  for (const ContactPoint& c : w.points)
    if (c.foreseen != Vec3::Zero()) put(w.foreseen, c.slot, Vec3::Zero());
  const Loads *now = &state.loads, *then = &w.earlier;
  for (const Loads* loads : {now, then})
    for (std::size_t k = 0; k < loads->count; ++k) {
      const Index slot = w.block.slot_of(loads->rows[k]);
      const Vec3 left = w.block.in_planes<float>(w.foreseen, slot);
      if (left == Vec3::Zero()) continue;
      put(w.foreseen, slot, Vec3::Zero());
      if (++asked <= most_asked) w.block.add_displacements(slot, -left, w.foreseen_moved);
    }
  if (asked > most_asked) return false;
  for (ContactPoint& c : w.points) c.foreseen_u = w.block.in_planes<float>(w.foreseen_moved, c.slot);
  return true;
}

}  // namespace palpate
