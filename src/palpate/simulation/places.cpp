// Contact points between nodes, on demand. Nodes alone do not see a needle in the middle of a triangle or a
// blade's edge across it. After a solve the deepest point of every triangle near an instrument is looked for
// (deepest.cpp); where it is deeper than what the triangle's corners can see, it becomes a contact point, a
// *place*, that rides on the three nodes by its barycentric coordinates, and the tick is solved again: the
// exchange method of semi-infinite programming (Hettich, Kortanek, "Semi-infinite programming: theory,
// methods, and applications", 1993). From solve to solve, and from tick to tick, places slide along with the
// instrument. What was passed through wholly within a tick is found by the samples' paths.
#include "palpate/simulation/places.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/simulation/deepest.hpp"

namespace palpate {

namespace {

// Cosine between a shape's normal and the way into a triangle it touches.
constexpr double least_facing = 0.3;
// Of half the instrument's thickness: when it moves by less, its places of the last tick will do for a start.
constexpr double hardly_moved = 0.25;
constexpr double met = 0.005;  // of a triangle: places that slide so near to each other are one

std::array<Vec3, 3> corners_at(const Model& model, std::size_t triangle, auto&& u_of) {
  std::array<Vec3, 3> out;
  for (std::size_t k = 0; k < 3; ++k) {
    const Index node = model.organ.surface.triangles[triangle][k];
    out[k] = model.organ.contact_points[at(node)];
    if (model.organ.row_of[at(node)] >= 0) out[k] += u_of(node);
  }
  return out;
}

// Under the last tick's loads.
std::array<Vec3, 3> corners_before(const Model& model, State& state, std::size_t triangle) {
  StepScratch& w = *state.scratch;
  return corners_at(model, triangle, [&](Index node) {
    if (std::exchange(w.u_before_number[at(node)], w.stamp(w.ticks)) != w.stamp(w.ticks))
      w.u_before[at(node)] = displacement_before(model, state, node);
    return w.u_before[at(node)];
  });
}

std::array<Vec3, 3> corners_now(const Model& model, State& state, std::size_t triangle) {
  return corners_at(model, triangle, [&](Index node) { return displacement(model, state, node); });
}

// A grasped node goes with the grip.
bool is_free(const Model& model, const StepScratch& w, std::size_t triangle) {
  const Triangle& nodes = model.organ.surface.triangles[triangle];
  return std::none_of(nodes.begin(), nodes.end(), [&](Index node) { return w.grasped[at(node)] != 0; });
}

// What counts as reaching into a triangle, m: a thousandth of the tick's motion.
double least_depth(const StepScratch& w, std::size_t triangle, std::size_t instrument) {
  return w.tolerance + fine * w.faces.faces[triangle].longest + 0.002 * w.sweeps[instrument].way;
}

// What counts as a turn of a place's facing: as exact as the solver is with nodes, and what a motion by a
// triangle's edge allows for.
double least_turn(const StepScratch& w, std::size_t triangle, std::size_t instrument) {
  return 1e-3 + 0.06 * std::min(1.0, w.sweeps[instrument].way / w.faces.faces[triangle].longest);
}

constexpr double on_edge = 1e-3;  // weight of a corner, below which a place is on the edge opposite to it

struct Facing {
  Vec3 into = Vec3::Zero();  // the organ, unit; 0: the triangle has shrunk to nothing
  bool ridge = false;        // on an edge that stands out: the same place for both its triangles
};

// Which way the force at a place goes. In a triangle and in a valley along the triangle's normal, as a plane
// and a tip have no other in common. On an edge that stands out it is the instrument's normal, which turns
// from one triangle's to the other's as a tip goes over the edge. u_of(node): displacements, of which the
// corners are.
template <class Displacement>
Facing facing_at(const Model& model, const StepScratch& w, std::size_t triangle, std::size_t instrument,
                 const Vec3& weights, const std::array<Vec3, 3>& corners, const Displacement& u_of) noexcept {
  Facing out{inwards(corners)};
  int k = 0;
  if (weights.minCoeff(&k) >= on_edge || w.faces.faces[triangle].beside[at(k)] < 0) return out;
  const auto other = at(w.faces.faces[triangle].beside[at(k)]);
  const std::array<Vec3, 3> beyond = corners_at(model, other, u_of);
  const Vec3 far = beyond[0] + beyond[1] + beyond[2] - corners[at((k + 1) % 3)] - corners[at((k + 2) % 3)];
  if ((far - corners[at((k + 1) % 3)]).dot(out.into) <= 0) return out;
  out.ridge = true;
  const Vec3 edge = (corners[at((k + 2) % 3)] - corners[at((k + 1) % 3)]).normalized();
  const Vec3 into = inwards(beyond);
  const Vec3 p = weights[0] * corners[0] + weights[1] * corners[1] + weights[2] * corners[2] -
                 w.faces.allowance(triangle, instrument, weights) * w.faces.faces[triangle].normal;
  Vec3 between = w.shapes[instrument].gap(p).normal;
  between -= between.dot(edge) * edge;
  const double turn = out.into.cross(into).dot(edge);
  if (!(between.dot(out.into + into) > 0) || out.into.cross(between).dot(edge) * turn <= 0) return out;
  out.into = between.cross(into).dot(edge) * turn <= 0 ? into : Vec3(between.normalized());
  return out;
}

// The plane that stands for an instrument at a place: what touches a triangle is on the side it faces. False
// where it has come round an edge of the instrument. What the instrument cuts after a fast motion, or has
// pierced, is let out along its normal.
bool take_plane(const StepScratch& w, const Vec3& facing, ContactPoint& c) noexcept {
  const PlacedShape& shape = w.shapes[at(c.instrument)];
  if (!(facing.squaredNorm() > 0.5)) return false;  // the triangle has shrunk to nothing
  const Vec3 p = c.rest + c.u;
  Gap g = shape.gap(p);
  double along = g.normal.dot(facing);
  if (along < least_facing) g = gap_by_path(shape, c.path, p), along = g.normal.dot(facing);
  if (along < least_facing && (g.distance < 0 || has_passed(shape, c.path, p))) {
    const bool pierced = shape.distance(p) < -0.5 * w.faces.thickness[at(c.instrument)];
    const double way = std::max(w.sweeps[at(c.instrument)].way, way_of(shape, c.path, p));
    const double most = 2 * way + (pierced ? w.faces.faces[at(c.triangle)].longest : 0);
    if (const double depth = way_out(shape, p, facing, most); depth <= most)
      g = {-depth, facing, 1}, along = 1;
  }
  if (along < least_facing) return false;
  c.facing = facing, c.tilt = along * g.slope, c.offset = g.distance - c.tilt * facing.dot(c.u);
  return true;
}

// Of a climb from where the deepest point was, a share of the triangle: less and less moves from round to
// round.
double first_step(const StepScratch& w) { return w.round == 0 ? 0.25 : w.round == 1 ? 0.1 : 0.03; }

// How a triangle is looked at: whole, by all it may have met on its way too; or from the deepest point that
// was found in this tick.
enum class Look { whole, again };

// The deepest point of a triangle; swept: it is known by the way it came there alone.
Deepest search(const Model& model, State& state, View& view, LookedAt& seen, bool& swept) {
  const StepScratch& w = *state.scratch;
  const double longest = w.faces.faces[view.triangle].longest;
  const double leaf = view.leaf(), more = least_depth(w, view.triangle, view.instrument);
  const Samples samples = sample(view, leaf, w.tolerance);
  Deepest best;
  for (Deepest start : samples.best) {
    // From farther off it does not come in within its part of the triangle.
    if (!(start.size > 0) || start.depth < -0.6 * start.size * longest) continue;
    climb(view, std::max(w.tolerance, best.depth), 0.1 * more, start);
    if (start.depth > best.depth) best = start;
  }
  double clearance = best.size > 0 ? more - best.depth : w.tolerance - samples.bound;
  seen.weights = best.size > 0 ? best.weights : Vec3(Vec3::Zero());
  float softness = 0;  // the tissue's way counts, too: first at most, then as it is
  for (const Index node : model.organ.surface.triangles[view.triangle])
    softness = std::max(softness, w.softness[at(node)]);
  swept = best.depth <= more &&
          way_between(w, view.instrument, static_cast<double>(softness) * w.travel.come) > 0;
  if (swept) {
    view.before = corners_before(model, state, view.triangle);
    double way = 0;
    for (std::size_t k = 0; k < 3; ++k) way = std::max(way, (view.now[k] - view.before[k]).norm());
    swept = way_between(w, view.instrument, way) > 0;
  }
  if (swept) {
    const double slack = 0.1 * longest, radius = std::max(radius_of(view.now), radius_of(view.before));
    const Vec3 middle = Vec3::Constant(1.0 / 3);
    if (!passes(*view.shape.shape, view.sweep.last * view.point(view.before, middle),
                view.shape.own(view.point(view.now, middle)), radius + slack)) {
      swept = false, clearance = std::min(clearance, slack);
    } else {
      clearance = -1;
      const Deepest passed = sample_swept(view, leaf, more);
      if (passed.size > 0)
        best = passed;
      else
        swept = false;
    }
  }
  seen.corners = view.now, seen.tick = w.ticks;
  seen.clearance = clearance / 1.1;  // an interpolated distance changes by hardly more than the way
  return best;
}

// It slips from where it was on the instrument.
void slip_from(const Model& model, const View& view, ContactPoint& c) {
  c.path = view.path(c.weights);
  if (!view.sweep.known || !(model.settings.friction > 0)) return;
  c.held = true;
  c.reference = view.shape.to_organ * (view.sweep.last * view.point(view.before, c.weights)) - c.rest;
}

// A place of the same instrument so near in the same triangle, or beyond its edges, if there is one.
ContactPoint* place_beside(StepScratch& w, const ContactPoint& c, double near, bool beyond) {
  const auto found = std::find_if(w.points.begin(), w.points.end(), [&](const ContactPoint& other) {
    return (beyond ? other.triangle >= 0 : other.triangle == c.triangle) &&
           other.instrument == c.instrument && other.weights != Vec3::Zero() &&
           (other.rest - c.rest).norm() <= near;
  });
  return found == w.points.end() ? nullptr : &*found;
}

// Where an instrument reaches deepest into a triangle, if it does.
bool find_place(const Model& model, State& state, View& view, Look look, ContactPoint& c) {
  StepScratch& w = *state.scratch;
  const Face& face = w.faces.faces[view.triangle];
  const double more = least_depth(w, view.triangle, view.instrument);
  LookedAt& seen = w.looked_at[view.instrument * w.faces.faces.size() + view.triangle];
  const bool known = seen.tick == w.ticks;
  if (look == Look::again && (!known || seen.weights == Vec3::Zero())) return false;
  view.now = corners_now(model, state, view.triangle);
  double moved = 0;
  for (std::size_t k = 0; k < 3; ++k) moved = std::max(moved, (view.now[k] - seen.corners[k]).norm());
  if (known && moved < seen.clearance) return false;
  bool swept = false;
  Deepest best{seen.weights, -infinite, first_step(w)};
  if (look == Look::whole)
    best = search(model, state, view, seen, swept);
  else
    climb(view, more, 0.1 * more, best), seen.weights = best.weights;
  if (!(best.depth > w.tolerance)) return false;
  if (!swept) view.before = corners_before(model, state, view.triangle);
  c = place_at(model, w, view.triangle, view.instrument, best.weights);
  c.u = view.point(view.now, best.weights) - c.rest;
  slip_from(model, view, c);
  const Facing facing = facing_at(model, w, view.triangle, view.instrument, c.weights, view.now,
                                  [&](Index node) { return displacement(model, state, node); });
  if (facing.into.dot(face.normal) > -least_facing || !take_plane(w, facing.into, c)) return false;
  const double depth = -(c.offset + c.tilt * c.facing.dot(c.u));
  const bool is_new = !place_beside(w, c, (swept ? view.leaf() : 2 * fine) * face.longest, facing.ridge);
  if (is_new || !swept) w.left = std::max(w.left, depth);
  return depth > more && is_new;
}

}  // namespace

ContactPoint place_at(const Model& model, const StepScratch& w, std::size_t triangle, std::size_t instrument,
                      const Vec3& weights) {
  ContactPoint c;
  c.triangle = static_cast<Index>(triangle), c.instrument = static_cast<Index>(instrument);
  c.weights = weights;
  double most = -1;
  for (std::size_t k = 0; k < 3; ++k) {
    const Index node = model.organ.surface.triangles[triangle][k];
    if (model.organ.row_of[at(node)] >= 0 && weights[static_cast<int>(k)] > most)
      c.node = node, most = weights[static_cast<int>(k)];
  }
  c.row = model.organ.row_of[at(c.node)];
  c.rest = rest_at(model.organ, triangle, weights) -
           w.faces.allowance(triangle, instrument, weights) * w.faces.faces[triangle].normal;
  return c;
}

// Whether all nodes of a triangle bear the instrument.
bool lies_on(const Model& model, const StepScratch& w, std::size_t instrument, std::size_t triangle) {
  const Triangle& nodes = model.organ.surface.triangles[triangle];
  return std::all_of(nodes.begin(), nodes.end(), [&](Index node) {
    const Index point = w.point_of[instrument * model.organ.surface_size() + at(node)];
    return point >= 0 && w.points[at(point)].force != Vec3::Zero();
  });
}

void displace_points(State& state) {
  StepScratch& w = *state.scratch;
  if (!std::exchange(w.moved_forces, false)) return;
  std::size_t n = 0;
  for (const ContactPoint& c : w.points)
    if (c.force != Vec3::Zero()) w.point_slots[n] = c.slot, w.point_forces[n++] = c.force;
  w.block.displacements({w.point_slots.data(), n}, {w.point_forces.data(), n}, w.placed_u);
  for (ContactPoint& c : w.points) c.u = w.block.in_planes<double>(w.placed_u, c.slot);
}

namespace {

template <class Idle>
void erase_places(const Model& model, StepScratch& w, const Idle& idle) {
  const std::size_t erased =
      std::erase_if(w.points, [&](const ContactPoint& c) { return c.triangle >= 0 && idle(c); });
  if (erased == 0) return;
  w.places -= erased;
  for (std::size_t k = w.points.size(); k-- > 0;)
    if (const ContactPoint& c = w.points[k]; c.triangle < 0)
      w.point_of[at(c.instrument) * model.organ.surface_size() + at(c.node)] = static_cast<Index>(k);
}

// Places go along with their instruments, each to the deepest point of its triangle where that is by
// u_of(node). Where the instrument has left the triangle, and where two meet, they end. True when any moved.
template <class Displacement>
bool slide_places(const Model& model, State& state, const Displacement& u_of) {
  StepScratch& w = *state.scratch;
  bool any = false;
  for (ContactPoint& c : w.points) {
    if (c.triangle < 0) continue;
    View view{w.faces, w.shapes[at(c.instrument)], w.sweeps[at(c.instrument)], at(c.triangle),
              at(c.instrument)};
    view.now = corners_at(model, view.triangle, u_of);
    Deepest best{c.weights, -infinite, first_step(w)};
    const double depth = -view.shape.distance(view.point(view.now, c.weights));
    const double within = 0.1 * least_depth(w, view.triangle, view.instrument);
    climb(view, -infinite, within, best);
    const bool moves = best.depth > depth + within;
    ContactPoint moved = c;
    if (moves) {
      view.before = corners_before(model, state, view.triangle);
      moved = place_at(model, w, view.triangle, view.instrument, best.weights);
      moved.u = view.point(corners_now(model, state, view.triangle), best.weights) - moved.rest;
      moved.force = c.force;
      slip_from(model, view, moved);
    }
    const bool off = best.weights.minCoeff() < 1e-3 || best.weights.maxCoeff() >= at_node;
    const bool left = moves && w.round == 0 && off && -best.depth > 0.25 * view.sweep.way;
    const bool ridge =
        facing_at(model, w, view.triangle, view.instrument, moved.weights, view.now, u_of).ridge;
    c.triangle = -1;  // not there itself
    ContactPoint* other = place_beside(w, moved, met * w.faces.faces[view.triangle].longest, ridge);
    if (other) other->force += c.force;
    any = any || moves || other;
    c = moved;
    if (other || left) c.weights = Vec3::Zero();
  }
  erase_places(model, w, [](const ContactPoint& c) { return c.weights == Vec3::Zero(); });
  return any;
}

// Where a node is taken to be in a round: from the third on, where the solves swing from side to side, a
// share of the way to where it is, by Aitken's estimate from its last two swings (as in ContactSolver::calm).
const Vec3& seen(const Model& model, State& state, Index node) {
  StepScratch& w = *state.scratch;
  StepScratch::Seen& s = w.seen[at(node)];
  const std::uint64_t round = 64 * w.ticks + static_cast<std::uint64_t>(w.round);
  const std::uint64_t last = std::exchange(s.round, round);
  if (last == round) return s.u;
  const Vec3& u = displacement(model, state, node);
  if (last / 64 != w.ticks) {
    s.u = u, s.change = Vec3::Zero(), s.share = 1;
    return s.u;
  }
  const Vec3 r = u - s.u, d = r - s.change;
  s.share = r.dot(s.change) < 0 ? std::clamp(-s.share * s.change.dot(d) / d.squaredNorm(), 0.1, 1.0)
                                : std::min(1.0, 2 * s.share);
  s.u += s.share * r, s.change = r;
  return s.u;
}

}  // namespace

namespace {

// Whether places with a force are off their planes by now.
bool places_are_off(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  for (const ContactPoint& c : w.points) {
    if (c.triangle < 0 || c.force == Vec3::Zero()) continue;
    ContactPoint now = c;
    const Facing facing = facing_at(model, w, at(c.triangle), at(c.instrument), c.weights,
                                    corners_now(model, state, at(c.triangle)),
                                    [&](Index node) { return displacement(model, state, node); });
    if (!take_plane(w, facing.into, now)) continue;
    const double gap = now.offset + now.tilt * now.facing.dot(c.u), off = gap - c.gap;
    w.left = std::max(w.left, -gap);
    if (std::abs(off) > least_depth(w, at(c.triangle), at(c.instrument)) ||
        (now.facing - c.facing).norm() > least_turn(w, at(c.triangle), at(c.instrument)))
      return true;
  }
  return false;
}

// Of one instrument. True when there were any.
bool add_places_of(const Model& model, State& state, std::size_t instrument, Look look, bool early) {
  StepScratch& w = *state.scratch;
  bool added = false;
  for (const Index triangle : w.near_faces[instrument]) {
    View view{w.faces, w.shapes[instrument], w.sweeps[instrument], at(triangle), instrument};
    ContactPoint c;
    if (early && lies_on(model, w, instrument, view.triangle)) continue;
    if (!is_free(model, w, view.triangle) || !find_place(model, state, view, look, c)) continue;
    if (w.places == most_places || !has_room(w, 3)) {
      state.status |= too_many_contacts;
      continue;
    }
    w.points.push_back(c);
    ++w.places;
    added = true;
  }
  return added;
}

}  // namespace

void face_places(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  if (w.places == 0) return;
  const auto u_of = [&](Index node) { return seen(model, state, node); };
  if (w.round > 0 && slide_places(model, state, u_of)) w.moved_forces = true;
  for (ContactPoint& c : w.points) {
    if (c.triangle < 0) continue;
    const View view{w.faces, w.shapes[at(c.instrument)], w.sweeps[at(c.instrument)], at(c.triangle),
                    at(c.instrument)};
    const std::array<Vec3, 3> corners = corners_at(model, view.triangle, u_of);
    const Vec3 u = std::exchange(c.u, view.point(corners, c.weights) - c.rest);
    const Facing facing = facing_at(model, w, view.triangle, view.instrument, c.weights, corners, u_of);
    if (!take_plane(w, facing.into, c) && c.tilt == 0)  // else it keeps what it had
      c.facing = Vec3::UnitZ(), c.tilt = 1, c.offset = w.size - c.u.z();
    c.u = u;
  }
}

void drop_idle_places(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  if (w.places <= most_places / 2) return;
  erase_places(model, w, [](const ContactPoint& c) { return c.force == Vec3::Zero(); });
}

bool add_places(const Model& model, State& state, const Surface& surface, bool early) {
  StepScratch& w = *state.scratch;
  if (w.faces.empty() || model.settings.mode != Mode::unilateral) return false;
  const double drifted = drift(model, state, surface);
  w.left = 0;
  if (early)
    w.moved_forces = slide_places(model, state, [&](Index node) { return displacement(model, state, node); });
  const bool found = (drifted - w.lag_before.drifted) * w.softest <= w.reach;  // all, by detect()
  bool added = false;
  for (std::size_t i = 0; i < w.shapes.size(); ++i) {
    if (w.faces.thickness[i] == 0) continue;
    if (!found) find_faces(model, state, surface, i, drifted);
    if (!early) added = add_places_of(model, state, i, Look::again, early) || added;
  }
  const bool off = !early && places_are_off(model, state);
  if (added || (off && w.round % 3 != 0)) return true;  // there is more to come
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    if (w.faces.thickness[i] > 0 && !(early && w.sweeps[i].way <= hardly_moved * w.faces.thickness[i]))
      added = add_places_of(model, state, i, Look::whole, early) || added;
  return added || off;
}

}  // namespace palpate
