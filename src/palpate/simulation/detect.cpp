// What may touch in a tick: T 4.2, points that pass through instruments, and a surface that lags behind.
// A tick must know where the nodes near an instrument are now, but not where all are: the whole surface is
// the work of a Deformer, which may be another thread's and lag behind. Detection starts from the surface it
// is given, made under forces f0 of some earlier tick, and bounds how far a node can have moved since: with C
// symmetric positive definite, |u_i(f) - u_i(f0)| <= sqrt(lambda(C_ii)) sqrt((f - f0).C(f - f0)) (Cauchy,
// Schwarz). The surface's own last changes tell most of how it went on, and for f the rest is taken
// (travel.cpp). What may be near by that bound, and where it was last placed does not tell enough of where it
// is now, is placed exactly, by rows of C, summed in an order that does not depend on the bound. So
// a tick's cost follows the number of contacts, and its bits do not depend on the surface's age.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "palpate/simulation/tick_work.hpp"

namespace palpate {

namespace {

// Of the last tick's motion: farther on nothing is foreseen, nor when it turns back.
constexpr double most_ahead = 1.2;
// Of finest(shape): as deep as that a point's proxy is where its normal leads.
constexpr double hardly_off = 1e-2;

// Corners of the shape's box; of one without an end a cube of 10 cm.
std::array<Vec3, 8> corners_of(const Shape& shape) {
  Box box = bounding_box(shape);
  if (!box.max.allFinite() || !box.min.allFinite()) box = {Vec3::Constant(-0.05), Vec3::Constant(0.05)};
  std::array<Vec3, 8> out;
  for (std::size_t corner = 0; corner < 8; ++corner)
    out[corner] = {corner & 1 ? box.max.x() : box.min.x(), corner & 2 ? box.max.y() : box.min.y(),
                   corner & 4 ? box.max.z() : box.min.z()};
  return out;
}

}  // namespace

void place(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  const Pose to_organ = state.organ.inverse();
  const bool has_last = state.placed.size() == model.instruments.size() && state.loads.u_known &&
                        model.settings.mode == Mode::unilateral;
  w.shapes.clear();
  double along = 0, last_squared = 0;  // of the instruments that touched, m2
  for (std::size_t i = 0; i < model.instruments.size(); ++i) {
    const Shape& shape = model.instruments[i].shape;
    w.shapes.emplace_back(shape, to_organ * state.instruments[i]);
    const Sweep last = std::exchange(w.sweeps[i], Sweep());
    const std::array<Vec3, 8> own = corners_of(shape);
    Sweep& sweep = w.sweeps[i];
    for (std::size_t c = 0; c < own.size(); ++c) sweep.corners[c] = w.shapes[i].to_organ * own[c];
    const bool has_end = finest(shape) < std::numeric_limits<double>::infinity();
    if (has_end) sweep.epoch = last.epoch + 1;
    if (!has_last) continue;
    const bool touched = std::any_of(state.contacts.begin(), state.contacts.end(),
                                     [&](const Contact& c) { return at(c.instrument) == i; });
    double moved = 0;
    for (std::size_t c = 0; c < own.size(); ++c) {
      sweep.ways[c] = sweep.corners[c] - last.corners[c];
      if (has_end) moved = std::max(moved, sweep.ways[c].norm());
      if (touched) along += sweep.ways[c].dot(last.ways[c]), last_squared += last.ways[c].squaredNorm();
    }
    if (moved > largest_motion * w.size) {
      last_squared = std::numeric_limits<double>::infinity(), sweep.ways.fill(Vec3::Zero());
      state.status |= jumped;
      continue;
    }
    sweep.last = state.placed[i].inverse(), sweep.known = true, sweep.way = moved;
    sweep.epoch = last.epoch, sweep.gone = last.gone + moved;
  }
  const double least = 10 * w.tolerance;  // less is the solver's own noise
  w.ahead = last_squared > 8 * least * least ? std::clamp(along / last_squared, 0.0, most_ahead) : 0;
  state.placed.clear();
  for (const PlacedShape& shape : w.shapes) state.placed.push_back(shape.to_organ);
  w.before.copy(state.loads);
  w.travel.come_at_most = 2 * std::exchange(w.travel.come, 0.0);
}

namespace {

// Adds a node once an instrument; null when there is no room. u: now; path: how it came there.
ContactPoint* add_point(const Model& model, StepScratch& w, Index node, std::size_t instrument, const Vec3& u,
                        const Path& path, const Vec3& force = Vec3::Zero()) {
  Index& place = w.point_of[instrument * model.organ.surface_size() + at(node)];
  if (place >= 0) return &w.points[at(place)];
  if (!has_room(w, 1)) return nullptr;
  place = static_cast<Index>(w.points.size());
  ContactPoint c;
  c.node = node, c.row = model.organ.row_of[at(node)], c.instrument = static_cast<Index>(instrument);
  c.rest = model.organ.contact_points[at(node)];
  c.u = u;
  c.path = path;
  c.force = force;
  return &w.points.emplace_back(c);
}

void forget_points(const Model& model, StepScratch& w) {
  for (const ContactPoint& c : w.points) {
    if (c.triangle >= 0) {
      for (const Index node : model.organ.surface.triangles[at(c.triangle)]) w.grasped[at(node)] = 0;
      continue;
    }
    w.point_of[at(c.instrument) * model.organ.surface_size() + at(c.node)] = -1;
    w.grasped[at(c.node)] = 0;
  }
  w.points.clear();
  w.places = 0;
}

}  // namespace

bool has_room(const StepScratch& w, std::size_t more) {
  return w.points.size() + 2 * w.places + more <= w.capacity;
}

bool is_first(const Model& model, const StepScratch& w, const ContactPoint& c) {
  const auto own = static_cast<Index>(&c - w.points.data());
  const std::size_t s = model.organ.surface_size();
  for (std::size_t i = 0; i < w.shapes.size(); ++i)  // what touched in the last tick comes first
    if (const Index other = w.point_of[i * s + at(c.node)]; other >= 0 && other < own) return false;
  return own == w.point_of[at(c.instrument) * s + at(c.node)];
}

bool is_alone(const Model& model, const StepScratch& w, const ContactPoint& c) {
  for (Index other = 0; at(other) < w.shapes.size(); ++other)
    if (other != c.instrument && w.point_of[at(other) * model.organ.surface_size() + at(c.node)] >= 0)
      return false;
  return true;
}

void forget_near(StepScratch& w) {
  for (const Index node : w.near) w.is_near[at(node)] = 0;
  w.near.clear();
}

namespace {

// How the node came near the shape: where it was in the last tick.
Path path_of(const Model& model, State& state, std::size_t shape, Index node) {
  StepScratch& w = *state.scratch;
  const Sweep& sweep = w.sweeps[shape];
  if (!sweep.known) return {};
  return path_from(w.shapes[shape], sweep.last * Vec3(model.organ.contact_points[at(node)] +
                                                      displacement_before(model, state, node)));
}

// more: what the loads may go on by, sqrt J.
Whereabouts whereabouts(const Surface& surface, const Lag& lag, double more = 0) {
  const auto shift = [&](std::size_t k) {
    return Whereabouts::Shift{surface.changes[k].bounds, surface.changes[k].moved, lag.all.along[k]};
  };
  return {surface.bounds, surface.positions, {shift(0), shift(1)}, lag.all.besides + more};
}

// Whether a node that lies `d` off the shape where the surface leads may come nearer than `near` to the shape
// on its way through this tick.
bool may_meet(const StepScratch& w, const Surface& surface, std::size_t instrument, Index node, double d,
              double near) {
  const double off = std::max(w.lag.all.besides, w.lag_before.all.besides);
  const double clearance = near + static_cast<double>(w.softness[at(node)]) * off;
  if (d <= clearance || way_through(w, instrument) == 0) return d <= clearance;
  const PlacedShape& shape = w.shapes[instrument];
  return passes(*shape.shape, w.sweeps[instrument].last * whereabouts(surface, w.lag_before).of(node),
                shape.to_shape * whereabouts(surface, w.lag).of(node), clearance);
}

}  // namespace

void add_near(StepScratch& w, Index node) {
  if (!w.is_near[at(node)]) w.is_near[at(node)] = 1, w.near.push_back(node);
}

namespace {

// Nodes but for the points of this instrument that may be nearer than `reach` under state.loads, or that the
// shape passed through.
void find_candidates(const Model& model, State& state, const Surface& surface, std::size_t instrument,
                     double reach) {
  StepScratch& w = *state.scratch;
  const PlacedShape& shape = w.shapes[instrument];
  const Index* points = w.point_of.data() + instrument * model.organ.surface_size();
  w.candidates.clear();
  const Whereabouts where = whereabouts(surface, w.lag, w.travel.come_at_most);
  const double near = reach + (1 + w.lag.all.off()) * w.tolerance, swept = near + way_through(w, instrument);
  const auto add = [&](Index node, double d, double clear) {
    if (clear > swept + lipschitz * static_cast<double>(w.softness[at(node)]) * w.travel.come_at_most) return;
    add_near(w, node);
    if (!(clear > swept) && may_meet(w, surface, instrument, node, d, near)) w.candidates.push_back(node);
  };
  // Those whose distance is not remembered are looked at many at a time.
  std::array<Index, 32> open;
  std::array<Vec3, open.size()> own;
  std::array<Gap, open.size()> gap;
  std::size_t count = 0;
  const auto look = [&] {
    gaps(*shape.shape, std::span(own).first(count), gap);
    for (std::size_t k = 0; k < count; ++k) {
      const Index node = open[k];
      const double d = gap[k].distance;
      const double clear = d - lipschitz * static_cast<double>(w.softness[at(node)]) * w.lag.all.besides;
      if (surface.loads.u_known && clear > clearance(w, instrument, node))
        remember(w, instrument, node, clear, expected(w, surface, node));
      add(node, d, clear);
    }
    count = 0;
  };
  look_near(*surface.clusters, where, shape, swept, [&](Index node) {
    if (points[node] >= 0) return;
    const double remembered = clearance(w, instrument, node);
    if (remembered > swept) return add(node, remembered, remembered);
    open[count] = node, own[count] = shape.own(where.of(node));
    if (++count == open.size()) look();
  });
  look();
}

// Whether the node, displaced by u, is near where it is foreseen to be: as far as an eighth of the ways. Else
// it is held back, for when nothing goes as foreseen. With friction, grips and places any that is within
// reach is a point: where it was when it came to touch tells which way it slips. where: u and the change of u
// in the last tick, and how far these may be off.
bool may_touch(const Model& model, const State& state, std::size_t instrument, Index node,
               const Expected& where) {
  const StepScratch& w = *state.scratch;
  const auto& [u, change, off, off_change] = where;
  if (w.ahead == 0 || !w.travel.planes_known || !foreseeable(model, state)) return true;
  const double ways = w.sweeps[instrument].way + w.ahead * (change.norm() + off_change);
  const Vec3 ahead = model.organ.contact_points[at(node)] + u + w.ahead * change;
  return w.shapes[instrument].distance_in_band(ahead) - lipschitz * (off + w.ahead * off_change) <
         0.125 * ways + 0.02 * w.reach;
}

// Calls found(node, distance, u) for those of `candidates` that are nearer than `reach`, or passed through,
// but for those that are held back. looked_at: where they were before tissue went on its way in this tick, so
// that its way is off the clearance. A node is placed only where what is expected of it leaves open which it
// is.
template <class Found>
void near_now(const Model& model, State& state, const Surface& surface, std::size_t instrument,
              std::span<const Index> candidates, double reach, bool looked_at, Found&& found) {
  StepScratch& w = *state.scratch;
  const PlacedShape& shape = w.shapes[instrument];
  const double swept = std::max(reach, 1.5 * way_through(w, instrument)) + w.tolerance;
  const auto hold_back = [&](Index node, double least, double most, const Expected& where) {
    const bool held = least > 0 && most < reach && !may_touch(model, state, instrument, node, where);
    if (held) w.held_back.push_back({node, instrument});
    return held;
  };
  for (const Index node : candidates) {
    if (w.point_of[instrument * model.organ.surface_size() + at(node)] >= 0 || w.grasped[at(node)]) continue;
    const Expected there = expected(w, surface, node);
    // The way of the instrument and of the tissue, at most: what has passed through is hardly farther now.
    const double way = way_through(w, instrument, come_at_most(w, node, there));
    const double within = std::max(reach, 1.5 * way) + w.tolerance;
    if (clearance(w, instrument, node) >= (looked_at ? swept : within)) continue;
    const Vec3& rest = model.organ.contact_points[at(node)];
    const double about = shape.distance_in_band(rest + there.u), off = lipschitz * there.off;
    if (about - off >= within || hold_back(node, about - off, about + off, there)) {
      remember(w, instrument, node, about - off, there);
      continue;
    }
    const auto [placed, change] = place_about(model, state, node);
    w.placed[at(node)] = {placed, change, w.travel.changes, w.travel.planes_known};
    double d = shape.distance(rest + placed);
    remember(w, instrument, node, d, {placed, change, 0, 0});
    if (d >= within) continue;
    const Vec3& u = displacement(model, state, node);
    if (u != placed) d = shape.distance(rest + u);
    if (d >= reach && way > 0 && d < 1.5 * way &&
        way_through(w, instrument, (u - displacement_before(model, state, node)).norm()) > 0)
      d = std::min(d, gap_by_path(shape, path_of(model, state, instrument, node), rest + u).distance);
    if (d < reach && !hold_back(node, d, d, {u, change, 0, 0})) found(node, d, u);
  }
}

// Nodes that are nearer become points before the solve, m. What is farther hardly comes to touch in a tick;
// where it does, add_swallowed() finds it, and the tick solves again.
double reach_of(const StepScratch& w, std::size_t instrument) {
  const Sweep& sweep = w.sweeps[instrument];
  const double most = std::min(w.reach, w.shapes[instrument].band);
  return sweep.known && sweep.epoch != 0 ? std::min(most, 0.2 * w.reach + 1.2 * sweep.way) : most;
}

// What the instruments hold: three points a node, before all others.
void add_grasped(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  const Loads& loads = state.loads;
  for (const Grasp& g : state.grasps) {
    if (!has_room(w, 3)) {
      state.status |= too_many_contacts;
      return;
    }
    add_point(model, w, g.node, at(g.instrument), displacement(model, state, g.node), {});
    w.grasped[at(g.node)] = 1;
    ContactPoint c = w.points.back();
    w.points.pop_back();
    c.grasped = true;
    c.reference = w.shapes[at(g.instrument)].to_organ * g.place - c.rest;
    const auto end = loads.rows.begin() + static_cast<std::ptrdiff_t>(loads.count);
    const auto row = std::find(loads.rows.begin(), end, c.row);
    const Vec3 force = row == end ? Vec3(Vec3::Zero()) : *(loads.forces.begin() + (row - loads.rows.begin()));
    for (int a = 0; a < 3; ++a) {
      c.normal = Vec3::Unit(a), c.force = force[a] * c.normal;
      w.points.push_back(c);
    }
  }
}

// How the point of a contact of the last tick came near its instrument.
Path path_of(const State& state, const Contact& c) {
  const StepScratch& w = *state.scratch;
  const PlacedShape& shape = w.shapes[at(c.instrument)];
  if (!w.sweeps[at(c.instrument)].known) return {};
  const auto k = static_cast<std::size_t>(&c - state.contacts.data());
  // As the solver left it, where it left it on the surface.
  const bool known = k < w.paths.size() && w.paths[k].known && w.paths[k].from == c.from;
  return known && c.gap_after > -hardly_off * shape.finest ? w.paths[k] : path_from(shape, c.from);
}

// Whether a contact of the last tick is a place, and not all its nodes are in grips.
bool is_place(const Model& model, const StepScratch& w, const Contact& c) {
  if (at(c.triangle) >= w.faces.faces.size()) return false;
  const Triangle& nodes = model.organ.surface.triangles[at(c.triangle)];
  return std::any_of(nodes.begin(), nodes.end(),
                     [&](Index node) { return model.organ.row_of[at(node)] >= 0 && !w.grasped[at(node)]; });
}

// A place that bore a force in the last tick; null when there is no room.
ContactPoint* keep_place(const Model& model, State& state, const Contact& c, const Path& path) {
  StepScratch& w = *state.scratch;
  if (w.places == most_places || !has_room(w, 3)) return nullptr;
  ContactPoint p = place_at(model, w, at(c.triangle), at(c.instrument), c.weights);
  for (std::size_t k = 0; k < 3; ++k) {
    const Index node = model.organ.surface.triangles[at(c.triangle)][k];
    const double weight = c.weights[static_cast<int>(k)];
    if (model.organ.row_of[at(node)] < 0) continue;
    p.u += weight * displacement(model, state, node);
    for (ContactPoint& g : w.points)  // grasped since: its share of the load is not the grip's
      if (g.grasped && g.node == node) g.force -= weight * c.force_in_organ.dot(g.normal) * g.normal;
  }
  p.path = path;
  p.force = c.force_in_organ;
  ++w.places;
  return &w.points.emplace_back(p);
}

}  // namespace

void detect(const Model& model, State& state, const Surface& surface) {
  StepScratch& w = *state.scratch;
  forget_points(model, w);
  w.held_back.clear();
  add_grasped(model, state);
  std::size_t lost = state.contacts.size();  // whose forces no point goes on with
  for (const Contact& c : state.contacts) {
    if (c.instrument < 0 || at(c.instrument) >= w.shapes.size() || model.settings.mode != Mode::unilateral)
      continue;
    if (c.triangle < 0 && w.grasped[at(c.node)]) --lost;  // the grip has its force
    if (c.triangle < 0 ? w.grasped[at(c.node)] : !is_place(model, w, c)) continue;
    const std::size_t i = at(c.instrument);
    const Path path = path_of(state, c);
    ContactPoint* p = c.triangle < 0 ? add_point(model, w, c.node, i, displacement(model, state, c.node),
                                                 path, c.force_in_organ)
                                     : keep_place(model, state, c, path);
    if (!p) {
      state.status |= too_many_contacts;
      continue;
    }
    --lost;
    p->held = model.settings.friction > 0;
    p->reference = w.shapes[i].in_organ(c.touched) - p->rest;
  }
  if (lost > 0) w.moved_forces = true;
  w.lag = w.lag_before = lag_of(model, state, surface, w.earlier, 0.5 * w.travel.come_at_most);
  for (std::size_t i = 0; i < w.shapes.size(); ++i) {
    const double reach = reach_of(w, i);
    find_candidates(model, state, surface, i, reach);
    find_faces(model, state, surface, i, w.lag.drifted);
    if (w.candidates.empty() && (w.faces.empty() || w.near_faces[i].empty())) continue;
    near_now(model, state, surface, i, w.candidates, reach, false, [&](Index node, double, const Vec3& u) {
      if (!add_point(model, w, node, i, u, path_of(model, state, i, node))) state.status |= too_many_contacts;
    });
  }
}

bool add_held_back(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  const std::size_t before = w.points.size();
  for (const auto& [node, i] : w.held_back)
    if (!add_point(model, w, node, i, displacement(model, state, node), path_of(model, state, i, node)))
      state.status |= too_many_contacts;
  w.held_back.clear();
  return w.points.size() > before;
}

void detect_at_rest(const Model& model, State& state, const Surface& surface) {
  StepScratch& w = *state.scratch;
  forget_points(model, w);
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    near_nodes(*surface.clusters, w.rest_bounds, model.organ.contact_points, w.shapes[i], 0.0,
               [&](Index node, double) {
                 for (std::size_t other = 0; other < i; ++other)
                   if (w.point_of[other * model.organ.surface_size() + at(node)] >= 0) return;
                 if (!add_point(model, w, node, i, Vec3::Zero(), {})) state.status |= too_many_contacts;
               });
}

void see_anchored(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  for (const PlacedShape& shape : w.shapes)
    near_nodes(w.anchored, w.anchored_bounds, model.organ.contact_points, shape, -w.tolerance,
               [&](Index, double) { state.status |= anchor_touched; });
}

bool add_swallowed(const Model& model, State& state, const Surface& surface) {
  StepScratch& w = *state.scratch;
  const std::size_t before = w.points.size(), s = model.organ.surface_size();
  const bool one_instrument_a_node = model.settings.mode == Mode::prescribed;
  // Whether all that may have come near was near for detect().
  const bool all_near = model.settings.mode == Mode::unilateral && w.travel.come <= w.travel.come_at_most;
  w.lag = all_near ? lag_after(model, state, surface, w.lag_before, w.travel.come)
                   : lag_of(model, state, surface, w.before, w.travel.come);
  state.deepest_after = 0;
  for (const ContactPoint& c : w.points)
    state.deepest_after = std::max(state.deepest_after, c.grasped ? std::abs(c.gap) : -c.gap);
  for (std::size_t i = 0; i < w.shapes.size(); ++i) {
    if (!all_near) {  // near_now() looks so far for what has passed through
      const double way = way_through(w, i, w.softest * w.travel.come);
      find_candidates(model, state, surface, i, way > 0 ? 1.5 * way : -w.tolerance);
    }
    std::vector<Index>& nodes = all_near ? w.near : w.candidates;
    if (!has_room(w, nodes.size())) std::sort(nodes.begin(), nodes.end());  // who gets the last
    near_now(model, state, surface, i, nodes, -w.tolerance, all_near,
             [&](Index node, double d, const Vec3& u) {
               state.deepest_after = std::max(state.deepest_after, -d);
               for (std::size_t other = 0; one_instrument_a_node && other < w.shapes.size(); ++other)
                 if (w.point_of[other * s + at(node)] >= 0) return;
               if (!add_point(model, w, node, i, u, path_of(model, state, i, node)))
                 state.status |= too_many_contacts;
             });
  }
  // The order of the points decides bits; that of what is near depends on the surface's age.
  const auto added = w.points.begin() + static_cast<std::ptrdiff_t>(before);
  std::sort(added, w.points.end(), [](const ContactPoint& a, const ContactPoint& b) {
    return std::pair(a.instrument, a.node) < std::pair(b.instrument, b.node);
  });
  for (std::size_t k = before; k < w.points.size(); ++k)
    w.point_of[at(w.points[k].instrument) * s + at(w.points[k].node)] = static_cast<Index>(k);
  return w.points.size() > before;
}

}  // namespace palpate
