// Where nodes are under a tick's loads: by rows of C against these, kept in the contact block or asked of the
// compliance, summed in an order that does not depend on what is watched.
#include <algorithm>
#include <limits>

#include "palpate/simulation/tick_work.hpp"

namespace palpate {

void hold(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  w.wanted.clear();
  const auto want = [&](Index row) {  // there is no room for twice the same
    if (row < 0 || w.is_wanted[at(row)] || w.wanted.size() == w.block.capacity()) return;
    w.is_wanted[at(row)] = 1, w.wanted.push_back(row);
  };
  for (const ContactPoint& c : w.points)
    if (c.triangle < 0)
      want(c.row);
    else
      for (const Index node : model.organ.surface.triangles[at(c.triangle)])
        want(model.organ.row_of[at(node)]);
  // These, too, as displacement_before() and travel() ask for them.
  for (const Loads* loads : {&state.loads, &w.before, &w.earlier})
    for (std::size_t i = 0; i < loads->count && (loads != &w.earlier || w.places == 0); ++i)
      want(loads->rows[i]);
  for (const Index row : w.wanted) w.is_wanted[at(row)] = 0;
  w.block.require(w.compliance_of(model), w.wanted);
  for (ContactPoint& c : w.points) {
    c.slot = c.triangle < 0 ? w.block.slot_of(c.row) : -1;
    if (c.triangle < 0) continue;
    std::array<Index, 3> slots;
    for (std::size_t k = 0; k < 3; ++k) {
      const Index row = model.organ.row_of[at(model.organ.surface.triangles[at(c.triangle)][k])];
      slots[k] = row < 0 ? -1 : w.block.slot_of(row);
    }
    c.slot = w.block.combine(slots, c.weights);
  }
  spread(w, state.loads, w.loaded);
  spread(w, w.before, w.loaded_before);
  if (w.earlier.u_known) spread(w, w.earlier, w.loaded_earlier);
}

void spread(StepScratch& w, const Loads& loads, StepScratch::Spread& spread) {
  const std::span<Index> slots = std::span(spread.slots).first(loads.count);
  for (std::size_t i = 0; i < loads.count; ++i) slots[i] = w.block.slot_of(loads.rows[i]);
  spread.loadable = std::all_of(slots.begin(), slots.end(), [&](Index s) { return w.block.is_loadable(s); });
  if (spread.loadable) w.block.spread(slots, {loads.forces.data(), loads.count}, spread.planes);
}

namespace {

// Where the row is kept, or is from now on; -1: nowhere, as the block's would not have the bits of its own.
Index kept_slot(StepScratch& w, const Compliance& compliance, Index row) {
  const Index slot = w.block.slot_of(row);
  if (w.block.is_loadable(slot)) return slot;
  return compliance.mirrors_bits() ? w.block.watch(compliance, row) : -1;
}

Vec3 displacement(const Model& model, StepScratch& w, Index node, const Loads& loads,
                  const StepScratch::Spread& spread) {
  const std::size_t n = loads.count;
  const Index row = model.organ.row_of[at(node)];
  const Compliance& compliance = w.compliance_of(model);
  const Index slot = spread.loadable ? kept_slot(w, compliance, row) : -1;
  if (slot >= 0) return w.block.displacement(slot, spread.planes);
  compliance.block({&row, 1}, {loads.rows.data(), n}, {w.compliance_rows.data(), 9 * n}, 3 * n);
  return ContactBlock::displacement(w.compliance_rows.data(), {loads.forces.data(), n});
}

}  // namespace

void found_displacement(StepScratch& w, Index node, const Vec3& u, std::uint64_t number) {
  w.u[at(node)] = u, w.u_number[at(node)] = w.stamp(number);
}

const Vec3& displacement(const Model& model, State& state, Index node) {
  StepScratch& w = *state.scratch;
  if (w.u_number[at(node)] != w.stamp(state.loads.number))
    found_displacement(w, node, displacement(model, w, node, state.loads, w.loaded), state.loads.number);
  return w.u[at(node)];
}

Vec3 displacement_about(const Model& model, State& state, Index node) {
  StepScratch& w = *state.scratch;
  const Index row = model.organ.row_of[at(node)];
  if (w.u_number[at(node)] == w.stamp(state.loads.number) || w.compliance_of(model).mirrors_bits() ||
      w.block.is_loadable(w.block.slot_of(row)) || !w.loaded.loadable)
    return displacement(model, state, node);
  return w.block.displacement(w.block.watch(w.compliance_of(model), row), w.loaded.planes);
}

Vec3 displacement_before(const Model& model, State& state, Index node) {
  StepScratch& w = *state.scratch;
  return state.loads.number == w.before.number ? displacement(model, state, node)
                                               : displacement(model, w, node, w.before, w.loaded_before);
}

namespace {

// What the last change of the loads did to the node, m; infinite: not known.
Vec3 last_change_of(const Model& model, StepScratch& w, Index node) {
  const Index row = model.organ.row_of[at(node)];
  Index slot = w.block.slot_of(row);
  if (w.travel.planes_known && !w.block.is_loadable(slot)) slot = w.block.watch(w.compliance_of(model), row);
  return w.travel.planes_known && slot >= 0 ? w.block.displacement(slot, w.travel.planes)
                                            : Vec3(Vec3::Constant(std::numeric_limits<double>::infinity()));
}

}  // namespace

std::array<Vec3, 2> place_about(const Model& model, State& state, Index node) {
  StepScratch& w = *state.scratch;
  const bool at_once =
      w.u_number[at(node)] != w.stamp(state.loads.number) && w.loaded.loadable && w.travel.planes_known;
  const Index slot = at_once ? kept_slot(w, w.compliance_of(model), model.organ.row_of[at(node)]) : -1;
  if (slot < 0) return {displacement_about(model, state, node), last_change_of(model, w, node)};
  const std::array<Vec3, 2> both = w.block.displacement(slot, w.loaded.planes, w.travel.planes);
  found_displacement(w, node, both[0], state.loads.number);
  return both;
}

}  // namespace palpate
