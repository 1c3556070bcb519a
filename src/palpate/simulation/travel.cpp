// How far nodes may have moved, and so what an instrument cannot have met. Where C is symmetric positive
// definite, a change df of the loads moves node i by no more than sqrt(tr C_ii) sqrt(df.C df) (Cauchy,
// Schwarz). That is ten times too far for a node beside a patch that an instrument drags along, which all
// goes the same way. But while a motion goes on, the change of a tick is nearly that of the one before, times
// a factor: df_n = a df_(n-1) + e, a by least squares in the energy. A node that df_(n-1) moved by v (one
// more product with its row, when it is placed) is moved by no more than |a v| + sqrt(tr C_ii) sqrt(e.C e),
// and so on from change to change.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "palpate/simulation/tick_work.hpp"

namespace palpate {

namespace {

// Of df.C df, and of the energy of all loads: what float32 may hide where changes are summed up as such, and
// what is foreseen be off.
constexpr double hidden_change = 5e-4, hidden_beneath = 1e-9;

// Of a change: what is less beside that before is a smooth motion.
constexpr double hardly_besides = 0.2;
// Farther on or back nothing is told from the change before.
constexpr double most_along = 4;

double dot(std::span<const float> a, std::span<const float> b, std::size_t plane, std::size_t n) noexcept {
  double sum = 0;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t k = axis * plane; k < axis * plane + n; ++k)
      sum += static_cast<double>(a[k]) * static_cast<double>(b[k]);
  return sum;
}

void subtract(const ContactBlock& block, const StepScratch::Spread& a, const StepScratch::Spread& b,
              std::vector<float>& out) noexcept {
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t k = axis * block.plane(); k < axis * block.plane() + block.width(); ++k)
      out[k] = a.planes[k] - b.planes[k];
}

}  // namespace

double drift(const Model& model, State& state, const Loads& then) {
  if (then.number == state.loads.number) return 0;
  const double work = state.loads.work(), work_then = then.work();
  double both = 0;
  for (std::size_t i = 0; i < then.count; ++i)
    both += then.forces[i].dot(displacement_about(model, state, model.organ.node_of_row[at(then.rows[i])]));
  return std::sqrt(std::max(0.0, work - 2 * both + work_then) + hidden * (std::abs(work) + work_then));
}

void travel(const Model& model, State& state, bool whole) {
  StepScratch& w = *state.scratch;
  Travel& t = w.travel;
  whole = whole && w.places == 0 && state.grasps.empty() && w.before.u_known && w.loaded.loadable &&
          w.loaded_before.loadable;
  Travel::Way way;
  double work = 0, come = 0;
  if (whole) {
    const auto with = [&](std::span<const float> planes) {
      return dot(planes, w.solver.moved(), w.block.plane(), w.block.used());
    };
    const double beneath = hidden_beneath * (std::abs(state.loads.work()) + std::abs(w.before.work()));
    double before = 0;
    if (t.work > 0 && w.loaded_earlier.loadable) {
      subtract(w.block, w.loaded_before, w.loaded_earlier, t.planes);
      before = with(t.planes);
      way.along = std::abs(before / t.work);
    }
    subtract(w.block, w.loaded, w.loaded_before, t.planes);
    work = std::max(0.0, with(t.planes));
    come = std::sqrt((1 + hidden_change) * work + beneath);
    way.besides =
        std::sqrt(std::max(0.0, work - way.along * std::abs(before)) + hidden_change * work + beneath);
  } else {
    come = w.before.u_known ? drift(model, state, w.before) : std::sqrt(state.loads.work());
  }
  // At most as far as from the last tick's loads and back to where the round before had come.
  const double most = come + std::exchange(t.come, come);
  if (!whole || !(way.along <= most_along)) way = {0, most};
  t.travelled += most;
  t.work = work, t.planes_known = whole, t.smooth = way.besides <= hardly_besides * come;
  for (Travel::Since& since : t.since) {
    since.last = {way.along * since.last.along, way.along * since.last.besides + way.besides};
    since.all.along += since.last.along, since.all.besides += since.last.besides;
  }
  t.since[++t.changes % Travel::remembered] = {};
  if (std::isfinite(t.travelled)) return;  // else no distance that was remembered holds
  t.travelled = t.come = t.work = 0;
  for (Sweep& sweep : w.sweeps) sweep.epoch += sweep.epoch != 0;
}

namespace {

// By `way` of the changes since the last time the node was looked at, or by their energy, m.
double moved_at_most(const StepScratch& w, const StepScratch::Clear& clear, Index node,
                     Travel::Way Travel::Since::*way, double energy) {
  const auto softness = static_cast<double>(w.softness[at(node)]);
  if (w.travel.changes - clear.change >= Travel::remembered) return softness * energy;
  const Travel::Way& changes = w.travel.since[clear.change % Travel::remembered].*way;
  const double known = clear.speed * changes.along + softness * changes.besides;
  return known < softness * energy ? known : softness * energy;  // known may be no number
}

const StepScratch::Clear* looked_at(const StepScratch& w, std::size_t instrument, Index node) {
  const StepScratch::Clear& clear = w.clear[instrument * w.softness.size() + at(node)];
  return clear.epoch != 0 && clear.epoch == w.sweeps[instrument].epoch ? &clear : nullptr;
}

}  // namespace

// What a narrow band says beyond itself jumps.
void remember(StepScratch& w, std::size_t instrument, Index node, double distance, double speed) {
  const auto* band = std::get_if<std::shared_ptr<const BandLattice>>(w.shapes[instrument].shape);
  if (band) distance = std::min(distance, (*band)->band());
  w.clear[instrument * w.softness.size() + at(node)] = {distance + lipschitz * w.sweeps[instrument].gone,
                                                        w.sweeps[instrument].epoch, w.travel.travelled,
                                                        w.travel.changes, speed};
}

double speed_by_last(const StepScratch& w, std::size_t instrument, Index node) {
  const StepScratch::Clear* clear = looked_at(w, instrument, node);
  const double unknown = std::numeric_limits<double>::infinity();
  return clear ? moved_at_most(w, *clear, node, &Travel::Since::last, unknown) : unknown;
}

double clearance(const StepScratch& w, std::size_t instrument, Index node) {
  const StepScratch::Clear* clear = looked_at(w, instrument, node);
  if (!clear) return -std::numeric_limits<double>::infinity();
  const double moved =
      moved_at_most(w, *clear, node, &Travel::Since::all, w.travel.travelled - clear->travelled);
  return clear->distance - lipschitz * (moved + w.sweeps[instrument].gone);
}

double come_at_most(const StepScratch& w, std::size_t instrument, Index node) {
  const StepScratch::Clear* clear = looked_at(w, instrument, node);
  if (!clear || w.round > 0) return static_cast<double>(w.softness[at(node)]) * w.travel.come;
  return moved_at_most(w, *clear, node, &Travel::Since::last, w.travel.come);
}

}  // namespace palpate
