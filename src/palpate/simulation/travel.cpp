// How far nodes may have moved, and so what an instrument cannot have met. Where C is symmetric positive
// definite, a change df of the loads moves node i by no more than sqrt(lambda(C_ii)) sqrt(df.C df) (Cauchy,
// Schwarz); lambda the largest eigenvalue. That is far too much for a node beside a patch that an instrument
// drags along, which all goes the same way. But while a motion goes on, the change of a tick is nearly that
// of the one before, times a factor: df_n = a df_(n-1) + e, a by least squares in the energy. A node that
// df_(n-1) moved by v (one more product with its row, when it is placed) is moved by a v, and what is off
// from that is no more than sqrt(lambda(C_ii)) sqrt(e.C e), and so on from change to change. The same of all
// nodes at once: a surface knows what changed from the one before (u1 = C df1), and by then from the one
// before that, which tells where a motion goes that has just turned back. So what changed since, of which
// df.C df1 = df.u1 needs no product, is a part of either and a rest.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "palpate/simulation/tick_work.hpp"

namespace palpate {

namespace {

// Of df.C df, and of the energy of all loads: what rounding (float32, rough products) may hide where changes
// are summed up as such, and what is foreseen be off.
constexpr double hidden_change = 5e-4, hidden_beneath = 1e-9;

// Of a change: what is less beside that before is a smooth motion.
constexpr double hardly_besides = 0.2;
// Farther on or back nothing is told from the change before.
constexpr double most_along = 4;
// Of a surface's changes.
constexpr double most_on = 16;
// Of the tolerance: where a node was is said to rounding (place_about()).
constexpr double rounded_off = 0.01;

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

// sqrt((f - f0).C(f - f0)) at most, sqrt J, by f.C f, f.C f0, f0.C f0.
double between(double work, double both, double then) {
  return std::sqrt(std::max(0.0, work - 2 * both + then) + hidden * (std::abs(work) + then));
}

}  // namespace

double drift(const Model& model, State& state, const Loads& then) {
  if (then.number == state.loads.number) return 0;
  double both = 0;
  for (std::size_t i = 0; i < then.count; ++i)
    both += then.forces[i].dot(displacement_about(model, state, model.organ.node_of_row[at(then.rows[i])]));
  return between(state.loads.work(), both, then.work());
}

namespace {

using OnChanges = std::array<double, 2>;

OnChanges on_changes(const Model& model, const Surface& surface, const Loads& loads) {
  const std::vector<Index>& nodes = model.organ.node_of_row;
  return {loads.work_on(nodes, surface.changes[0].moved), loads.work_on(nodes, surface.changes[1].moved)};
}

// A change of the loads by `come`, sqrt J, by least squares in the energy as shares of the surface's own.
// now, then: the work of the loads after and before it on these; rounding: of such works, J, more as more of
// them is taken.
Lag::Way against(const Surface& surface, const OnChanges& now, const OnChanges& then, double come,
                 double rounding) {
  Lag::Way way{{0, 0}, come};
  if (!surface.loads.u_known) return way;
  double rest = come * come, parts = 1;
  for (std::size_t k = 0; k < way.along.size(); ++k) {
    const double work = surface.changes[k].work;
    if (!(work > 0)) continue;
    const double on = now[k] - then[k];
    const double along = way.along[k] = std::clamp(on / work, -most_on, most_on);
    rest += along * (along * work - 2 * on), parts += std::abs(along);
  }
  way.besides = std::sqrt(std::max(0.0, rest) + parts * rounding);
  return way.besides < come ? way : Lag::Way{{0, 0}, come};
}

// Of the last change alone: what hides in it, J.
double hidden_in(const State& state, double come) {
  return hidden_change * come * come + hidden_beneath * std::abs(state.loads.work());
}

}  // namespace

// As C is symmetric, f.C f0 is what f would do where f0 has led: no node has to be placed for it.
double drift(const Model& model, const State& state, const Surface& surface) {
  if (surface.loads.number == state.loads.number) return 0;
  const auto on_surface = [&](const Loads& loads) {
    return loads.work_on(model.organ.node_of_row, surface.reading);
  };
  return between(state.loads.work(), on_surface(state.loads),
                 surface.loads.u_known ? surface.loads.work() : on_surface(surface.loads));
}

Lag lag_of(const Model& model, const State& state, const Surface& surface, const Loads& earlier,
           double come) {
  const double drifted = drift(model, state, surface);
  const OnChanges now = on_changes(model, surface, state.loads);
  return {drifted,
          against(surface, now, {surface.changes[0].of_loads, surface.changes[1].of_loads}, drifted,
                  hidden * (std::abs(state.loads.work()) + std::abs(surface.loads.work()))),
          against(surface, now, on_changes(model, surface, earlier), come, hidden_in(state, come)), now};
}

Lag lag_after(const Model& model, const State& state, const Surface& surface, const Lag& lag, double come) {
  const OnChanges now = on_changes(model, surface, state.loads);
  const Lag::Way last = against(surface, now, lag.on_changes, come, hidden_in(state, come));
  const auto& [a, b] = lag.all.along;
  return {lag.drifted + come,
          {{a + last.along[0], b + last.along[1]}, lag.all.besides + last.besides},
          last,
          now};
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
      way.along = before / t.work;
    }
    subtract(w.block, w.loaded, w.loaded_before, t.planes);
    work = std::max(0.0, with(t.planes));
    come = std::sqrt((1 + hidden_change) * work + beneath);
    way.besides = std::sqrt(std::max(0.0, work - way.along * before) + hidden_change * work + beneath);
  } else {
    come = w.before.u_known ? drift(model, state, w.before) : std::sqrt(state.loads.work());
  }
  // At most as far as from the last tick's loads and back to where the round before had come.
  const double most = come + std::exchange(t.come, come);
  if (!whole || !(std::abs(way.along) <= most_along)) way = {0, most};
  t.travelled += most;
  t.work = work, t.planes_known = whole, t.smooth = way.besides <= hardly_besides * come;
  for (Travel::Since& since : t.since) {
    since.last = {way.along * since.last.along, std::abs(way.along) * since.last.besides + way.besides};
    since.all.along += since.last.along, since.all.besides += since.last.besides;
  }
  t.since[++t.changes % Travel::remembered] = {};
  if (std::isfinite(t.travelled)) return;  // else no distance that was remembered holds
  t.travelled = t.come = t.work = 0;
  for (Sweep& sweep : w.sweeps) sweep.epoch += sweep.epoch != 0;
}

void forget_changes(Travel& t) {
  t.changes += Travel::remembered;
  t.work = 0, t.planes_known = t.smooth = false;
  t.since[t.changes % Travel::remembered] = {};
}

Expected expected(const StepScratch& w, Index node) {
  const StepScratch::Placed& placed = w.placed[at(node)];
  constexpr double unknown = std::numeric_limits<double>::infinity();
  if (!placed.known || w.travel.changes - placed.last >= Travel::remembered)
    return {Vec3::Zero(), Vec3::Zero(), unknown, unknown};
  const auto softness = static_cast<double>(w.softness[at(node)]);
  const Travel::Since& since = w.travel.since[placed.last % Travel::remembered];
  const double rounding = rounded_off * w.tolerance;
  return {placed.u + since.all.along * placed.change, since.last.along * placed.change,
          softness * since.all.besides + rounding, softness * since.last.besides + rounding};
}

Expected expected(const StepScratch& w, const Surface& surface, Index node) {
  const Expected there = expected(w, node);
  const auto softness = static_cast<double>(w.softness[at(node)]);
  const double off = softness * w.lag.all.besides + (1 + w.lag.all.off()) * w.tolerance;
  if (!surface.loads.u_known || off >= there.off) return there;
  const auto along = [&](const Lag::Way& way) {
    return Vec3(way.along[0] * surface.changes[0].moved[at(node)] +
                way.along[1] * surface.changes[1].moved[at(node)]);
  };
  return {surface.reading[at(node)].cast<double>() + along(w.lag.all), along(w.lag.last), off,
          softness * w.lag.last.besides + w.lag.last.off() * w.tolerance};
}

double come_at_most(const StepScratch& w, Index node, const Expected& there) {
  const double come = static_cast<double>(w.softness[at(node)]) * w.travel.come;
  return w.round > 0 ? come : std::min(come, there.change.norm() + there.off_change);
}

void remember(StepScratch& w, std::size_t instrument, Index node, double distance, const Expected& there) {
  const Sweep& sweep = w.sweeps[instrument];
  w.clear[instrument * w.softness.size() + at(node)] = {
      std::min(distance, w.shapes[instrument].band) + lipschitz * sweep.gone, sweep.epoch, w.travel.travelled,
      w.travel.changes, there.change.norm() + there.off_change};
}

double clearance(const StepScratch& w, std::size_t instrument, Index node) {
  const StepScratch::Clear& clear = w.clear[instrument * w.softness.size() + at(node)];
  const Sweep& sweep = w.sweeps[instrument];
  if (clear.epoch == 0 || clear.epoch != sweep.epoch) return -std::numeric_limits<double>::infinity();
  const auto softness = static_cast<double>(w.softness[at(node)]);
  double moved = softness * (w.travel.travelled - clear.travelled);
  if (w.travel.changes - clear.change < Travel::remembered) {
    const Travel::Way& changes = w.travel.since[clear.change % Travel::remembered].all;
    const double known = clear.speed * std::abs(changes.along) + softness * changes.besides;
    if (known < moved) moved = known;  // known may be no number
  }
  return clear.distance - lipschitz * (moved + sweep.gone);
}

}  // namespace palpate
