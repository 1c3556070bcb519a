// What a tick begins with. Between two ticks of a hand's motion forces change nearly as they did between the
// last two, in the proportion of the ways: the solver then has to find the change of the change, a tenth or
// less of what it would have to find from the last tick's forces.
#include <utility>

#include "palpate/simulation/tick_work.hpp"

namespace palpate {

bool predict(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  const bool known = w.ahead != 0 && w.earlier.u_known && state.loads.number == w.before.number;
  for (std::size_t k = 0; k < w.earlier.count; ++k)
    w.earlier_of[at(w.earlier.rows[k])] = static_cast<Index>(k);
  for (ContactPoint& c : w.points) {
    // Of a place the triangle's nodes had the forces, of a node of two instruments both.
    if (c.triangle >= 0 || c.grasped) continue;
    const StepScratch::Begun begun = std::exchange(w.begun[at(c.node)], {c.u, w.ticks});
    if (!known || !is_alone(model, w, c)) continue;
    if (begun.tick + 1 == w.ticks) c.foreseen_u = w.ahead * (c.u - begun.u);
    if (c.force == Vec3::Zero()) continue;
    const Index k = w.earlier_of[at(c.row)];
    c.foreseen = w.ahead * (k < 0 ? c.force : Vec3(c.force - w.earlier.forces[at(k)]));
  }
  for (std::size_t k = 0; k < w.earlier.count; ++k) w.earlier_of[at(w.earlier.rows[k])] = -1;
  w.earlier.copy(w.before);
  return known;
}

}  // namespace palpate
