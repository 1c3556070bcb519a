// One tick: place, detect, solve, report; and what the forces do to the surface. T 4.2 (detection), 4.3.2
// (forces from displacements), 5.2.
#include <algorithm>
#include <array>
#include <cmath>

#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/simulation/tick_work.hpp"

namespace palpate {

void DeleteScratch::operator()(StepScratch* scratch) const noexcept { delete scratch; }

namespace {

void require_usable(const Settings& s) {
  if (s.max_contacts < 1 || s.max_contacts > 5000)
    throw Error(ErrorKind::usage, "max_contacts is {}; use 1 to 5000", s.max_contacts);
  if (s.max_relinearisations < 1)
    throw Error(ErrorKind::usage, "max_relinearisations is {}; use 1 or more", s.max_relinearisations);
  if (!(s.tolerance > 0 && s.tolerance < 0.1))
    throw Error(ErrorKind::usage, "tolerance is {}; use more than 0 and less than 0.1 (of the organ's size)",
                s.tolerance);
  if (!(s.friction >= 0 && s.friction <= 10))
    throw Error(ErrorKind::usage, "friction is {}; use 0 to 10", s.friction);
  if (!(s.gaussian_radius > 0 && std::isfinite(s.gaussian_radius)))
    throw Error(ErrorKind::usage, "gaussian_radius is {}; use more than 0", s.gaussian_radius);
  if (!std::isfinite(s.gaussian_force))
    throw Error(ErrorKind::usage, "gaussian_force is {}; use a number", s.gaussian_force);
}

void require_usable(const Instrument& instrument) {
  if (is_empty(instrument.shape))
    throw Error(ErrorKind::usage, "instrument '{}' has an empty lattice", instrument.name);
  if (!has_size(instrument.shape))
    throw Error(ErrorKind::usage, "instrument '{}': its sizes must be above zero", instrument.name);
  if (!(instrument.tip >= 0 && std::isfinite(instrument.tip)))
    throw Error(ErrorKind::usage, "instrument '{}': its tip is {}; use 0 or more", instrument.name,
                instrument.tip);
}

}  // namespace

State make_state(const Model& model) {
  const Organ& organ = model.organ;
  const std::size_t s = organ.surface_size(), instruments = model.instruments.size();
  if (s == 0 || organ.compliance.nodes() == 0)
    throw Error(ErrorKind::usage, "the model's organ has no surface node that can move");
  require_usable(model.settings);
  for (const Instrument& instrument : model.instruments) require_usable(instrument);

  const auto capacity = std::min<std::size_t>(static_cast<std::size_t>(model.settings.max_contacts),
                                              s * std::max<std::size_t>(instruments, 3));
  State state;
  state.surface = make_surface(organ);
  state.loads = Loads(s);
  state.contacts.reserve(std::max(capacity, s));
  state.wrenches.assign(instruments, Wrench{});
  state.instruments.assign(instruments, Pose{});
  state.scratch.reset(new StepScratch(model, capacity, *state.surface.clusters));
  StepScratch& w = *state.scratch;
  std::vector<Index> anchored;
  for (std::size_t i = 0; i < s; ++i)
    if (organ.row_of[i] < 0) anchored.push_back(static_cast<Index>(i));
  w.anchored = Clusters(organ.contact_points, anchored);
  w.anchored_bounds = ClusterBounds(w.anchored);
  w.anchored_bounds.update(w.anchored, organ.contact_points);
  w.rest_bounds = state.surface.bounds;
  w.shapes.reserve(instruments);
  w.sweeps.resize(instruments);
  w.before = Loads(s);
  w.earlier = Loads(s), w.earlier.u_known = false;
  w.earlier_of.assign(organ.compliance.nodes(), -1);
  state.placed.reserve(instruments);
  w.points.reserve(capacity);
  w.paths.reserve(capacity);
  w.point_of.assign(s * instruments, -1);
  state.grasps.reserve(std::min(capacity / 3, s));
  w.grasped.assign(s, 0);
  w.candidates.reserve(s);
  w.near.reserve(s);
  w.held_back.reserve(s * instruments);
  w.is_near.assign(s, 0);
  w.wanted.reserve(w.block.capacity());
  w.is_wanted.assign(organ.compliance.nodes(), 0);
  w.near_faces.resize(w.faces.empty() ? 0 : instruments);
  for (std::vector<Index>& faces : w.near_faces) faces.reserve(organ.surface.triangles.size());
  w.u_before.assign(w.faces.empty() ? 0 : s, Vec3::Zero());
  w.u_before_number.assign(w.u_before.size(), 0);
  w.looked_at.resize(instruments * w.faces.faces.size());
  w.seen.resize(w.u_before.size());
  w.point_slots.resize(capacity), w.point_forces.resize(capacity), w.placed_u.resize(3 * w.block.plane());
  w.u.assign(s, Vec3::Zero());
  w.u_number.assign(s, 0);
  w.clear.resize(s * instruments);
  w.placed.resize(s);
  w.begun.resize(s);
  for (std::vector<float>* planes : {&w.travel.planes, &w.foreseen, &w.foreseen_moved})
    planes->resize(3 * w.block.plane());
  for (StepScratch::Spread* spread : {&w.loaded, &w.loaded_before, &w.loaded_earlier})
    spread->slots.resize(s), spread->planes.resize(3 * w.block.plane());
  w.mode = model.settings.mode;
  w.size = bounding_box(organ.surface.vertices).diagonal();
  w.tolerance = model.settings.tolerance * w.size;
  double area = 0;
  for (const double a : organ.areas) area += a;
  w.softness.assign(s, 0.0f);
  for (std::size_t i = 0; i < state.surface.clusters->nodes.size(); ++i)
    w.softness[at(state.surface.clusters->nodes[i])] = state.surface.clusters->softness[i];
  w.softest = static_cast<double>(*std::max_element(w.softness.begin(), w.softness.end()));
  w.reach = 0.25 * std::sqrt(area / static_cast<double>(s));
  return state;
}

namespace {

// Nothing is 1,000 km away; beyond, float32 would overflow before float64 does.
bool sensible(const Pose& p) {
  return p.translation.squaredNorm() < 1e12 && p.rotation.coeffs().allFinite() &&
         std::abs(p.rotation.norm() - 1) < 1e-3;
}

bool valid(const Model& model, const Input& input) {
  bool ok = input.instruments.size() == model.instruments.size() && sensible(input.organ) &&
            (input.grips.empty() || input.grips.size() == model.instruments.size());
  for (const Pose& p : input.instruments) ok = ok && sensible(p);
  return ok;
}

// The points' forces become the loads; a node touched by two instruments, or grasped, or carrying places, is
// one.
void take_loads(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  Loads& loads = state.loads;
  loads.count = 0;
  ++loads.number;
  const auto load_of = [&](Index row) {
    const auto end = loads.rows.begin() + static_cast<std::ptrdiff_t>(loads.count);
    return static_cast<std::size_t>(std::find(loads.rows.begin(), end, row) - loads.rows.begin());
  };
  const auto add = [&](Index row, const Vec3& force, bool is_new) {
    const std::size_t i = is_new ? loads.count : load_of(row);
    if (i == loads.count) loads.rows[loads.count] = row, loads.forces[loads.count++].setZero();
    loads.forces[i] += force;
    return i;
  };
  for (const ContactPoint& c : w.points) {
    if (c.triangle < 0) found_displacement(w, c.node, c.u, loads.number);
    if (c.force == Vec3::Zero()) continue;
    if (c.triangle < 0) {
      loads.u[add(c.row, c.force, w.places == 0 && is_first(model, w, c))] = c.u;
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const Index row = model.organ.row_of[at(model.organ.surface.triangles[at(c.triangle)][k])];
      const double weight = c.weights[static_cast<int>(k)];
      if (row >= 0 && weight > 0) add(row, weight * c.force, false);
    }
  }
  loads.u_known = true;
  spread(w, loads, w.loaded);
  if (w.places == 0) return;
  for (std::size_t i = 0; i < loads.count; ++i) {  // by the nodes' forces, as later ticks will do it
    const Index node = model.organ.node_of_row[at(loads.rows[i])];
    w.u_number[at(node)] = 0;
    loads.u[i] = displacement(model, state, node);
  }
}

// Where u came from all forces it was corrected, which foresee() would take for a motion.
void note_corrections(StepScratch& w, const SolverLimits& limits, const SolveResult& result) {
  const std::size_t each = result.by_changes ? limits.exact_each : 1;
  for (const ContactPoint& c : w.points)
    if (is_exact(c, each, limits.exact_first)) w.begun[at(c.node)].corrected = w.ticks;
}

constexpr int most_rounds = 24;
// Turns of a solve after which nodes that were held back may be what it misses.
constexpr int few_turns = 4;

// Solves until the forces swallow no other node, and no instrument reaches into a triangle between nodes.
void solve(const Model& model, State& state, const Surface& surface) {
  StepScratch& w = *state.scratch;
  SolverLimits limits{0.5 * w.tolerance, model.settings.max_relinearisations};
  SolveResult result;
  w.round = 0, w.left = 0;
  if (w.places > 0) add_places(model, state, surface, true);  // where instruments went on
  for (; w.round < most_rounds; ++w.round) {
    const bool whole = w.round == 0 && !w.moved_forces;
    face_places(model, state);
    hold(model, state);
    displace_points(state);
    for (ContactPoint& c : w.points) c.foreseen.setZero(), c.foreseen_u.setZero();
    // All at once where what sticks or is held must not drift.
    limits.exact_first = state.loads.number % exact_every;
    limits.exact_each = foreseeable(model, state) ? exact_every : limits.exact_first == 0 ? 1 : 0;
    limits.predicted = w.round == 0 && model.settings.mode == Mode::unilateral && predict(model, state);
    const bool foreseen = limits.predicted && whole && foresee(model, state);
    limits.foreseen_moved = foreseen ? w.foreseen_moved : std::span<const float>();
    if (w.round == 0) w.earlier.copy(w.before);
    const int left = limits.max_relinearisations;
    if (!w.held_back.empty()) limits.max_relinearisations = std::min(left, few_turns);
    if (!w.points.empty())
      result = model.settings.mode == Mode::prescribed
                   ? w.solver.prescribed(w.block, w.shapes, w.points, limits)
                   : w.solver.solve(w.block, w.shapes, w.points, model.settings.friction, limits);
    else
      result.converged = true;
    note_corrections(w, limits, result);
    state.relinearisations += result.relinearisations;
    limits.max_relinearisations = left - result.relinearisations;
    take_loads(model, state);
    travel(model, state, whole && result.by_changes);
    drop_idle_places(model, state);
    if (!result.converged && limits.max_relinearisations > 0 && add_held_back(model, state)) continue;
    if (!add_swallowed(model, state, surface) && !add_places(model, state, surface)) {
      if (!result.converged || state.deepest_after > w.tolerance) state.status |= not_converged;
      return;
    }
    if (limits.max_relinearisations <= 0) break;
  }
  state.status |= not_converged;
}

// Contacts in the world, and what the instruments feel.
void report(State& state) {
  StepScratch& w = *state.scratch;
  const Mat3 turn = state.organ.rotation.toRotationMatrix();
  state.deepest_after = std::max(state.deepest_after, w.left);
  state.contacts.clear(), w.paths.clear();
  for (Wrench& wrench : state.wrenches) wrench = {};
  for (std::size_t i = 0; i < w.points.size(); i += w.points[i].grasped ? 3 : 1) {
    ContactPoint& p = w.points[i];
    const PlacedShape& shape = w.shapes[at(p.instrument)];
    const Vec3 force = p.grasped ? Vec3(p.force + w.points[i + 1].force + w.points[i + 2].force) : p.force;
    if (force == Vec3::Zero()) continue;
    Contact c;
    c.grasped = p.grasped;
    c.node = p.node, c.instrument = p.instrument, c.triangle = p.triangle, c.weights = p.weights;
    const Vec3 now = p.rest + p.u;
    c.gap_after = p.grasped ? shape.distance(now) : p.gap;
    if (p.triangle >= 0) gap_by_path(shape, p.path, now, &p.path);
    c.from = p.path.known ? p.path.from : shape.own(now);
    c.touched = shape.own(p.sticks ? Vec3(p.rest + p.reference) : now);
    c.force_in_organ = force, c.force = turn * force;
    c.point = turn * now + state.organ.translation;
    state.contacts.push_back(c), w.paths.push_back(p.path);
    Wrench& wrench = state.wrenches[at(p.instrument)];
    const Vec3 arm = c.point - state.instruments[at(p.instrument)].translation;
    wrench.force -= c.force;
    wrench.torque -= arm.cross(c.force);
    state.deepest_after = std::max(state.deepest_after, -c.gap_after);
  }
}

}  // namespace

void tick(const Model& model, State& state, const Input& input, const Surface& surface) noexcept {
  const Timer total = wall_timer();
  state.time = input.time;
  state.times = {};
  state.relinearisations = 0;
  if (!valid(model, input)) {
    state.status = bad_input;
    return;
  }
  state.status = status_ok;
  ++state.scratch->ticks;
  state.deepest_before = state.deepest_after = 0;
  state.organ = normalized(input.organ);
  std::transform(input.instruments.begin(), input.instruments.end(), state.instruments.begin(), normalized);
  StepScratch& w = *state.scratch;
  // What another mode left is no beginning.
  const Mode last = std::exchange(w.mode, model.settings.mode);
  if (last != w.mode) state.loads.u_known = false, state.contacts.clear();
  place(model, state);
  forget_near(w);
  if (!state.loads.u_known) {
    state.loads.count = 0, ++state.loads.number;
    spread(w, state.loads, w.loaded);
    forget_changes(w.travel);
  }
  switch (model.settings.mode) {
    case Mode::unilateral:
    case Mode::prescribed: {
      Timer timer = wall_timer();
      see_anchored(model, state);
      let_go(model, state, input);
      model.settings.mode == Mode::prescribed ? detect_at_rest(model, state, surface)
                                              : detect(model, state, surface);
      state.times.detect = timer.seconds();
      timer = wall_timer();
      solve(model, state, surface);
      report(state);
      if (model.settings.mode == Mode::unilateral) grasp(model, state, input);
      state.times.solve = timer.seconds();
      break;
    }
    case Mode::gaussian:
      gaussian(model, state);
      break;
    case Mode::imprint:
      imprint(model, state);
      break;
  }
  state.times.total = total.seconds();
}

namespace {

// How deep the contacts would be at rest: what no force depends on, so it is not the force loop's work.
void find_depths_at_rest(const Model& model, Outcome& outcome) noexcept {
  outcome.deepest_before = 0;
  const auto rest_of = [&](const Contact& c) {
    return c.triangle < 0 ? model.organ.contact_points[at(c.node)]
                          : rest_at(model.organ, at(c.triangle), c.weights);
  };
  std::array<Vec3, 32> own;
  std::array<Gap, 32> found;
  for (std::size_t first = 0, end = 0; first < outcome.contacts.size(); first = end) {
    const std::size_t instrument = at(outcome.contacts[first].instrument);
    const Pose to_shape = outcome.instruments[instrument].inverse() * outcome.organ;
    for (; end < outcome.contacts.size() && end - first < own.size() &&
           at(outcome.contacts[end].instrument) == instrument;
         ++end)
      own[end - first] = to_shape * rest_of(outcome.contacts[end]);
    gaps(model.instruments[instrument].shape, std::span(own).first(end - first), found);
    for (std::size_t i = first; i < end; ++i) {
      outcome.contacts[i].gap_before = found[i - first].distance;
      outcome.deepest_before = std::max(outcome.deepest_before, -found[i - first].distance);
    }
  }
}

}  // namespace

void deform(const Model& model, const Loads& loads, Deformer& deformer, Surface& surface,
            Outcome& outcome) noexcept {
  const Timer timer = wall_timer();
  deformer(model.organ, loads, surface);
  if (surface.strains.beyond_linear()) outcome.status |= strain_beyond_linear;
  if (model.settings.mode == Mode::unilateral || model.settings.mode == Mode::prescribed)
    find_depths_at_rest(model, outcome);
  outcome.times.deform = timer.seconds();
  outcome.times.total += outcome.times.deform;
}

void step(const Model& model, State& state, const Input& input) noexcept {
  tick(model, state, input, state.surface);
  if (state.status & bad_input || model.settings.mode == Mode::imprint) return;
  deform(model, state.loads, state.scratch->deformer, state.surface, state);
}

}  // namespace palpate
