// One tick: place, detect, solve, report; and what the forces do to the surface. T 4.2 (detection), 4.3.2
// (forces from displacements), 5.2.
//
// A tick must know where the nodes near an instrument are now, but not where all are: the whole surface is
// the work of a Deformer, which may be another thread's and lag behind. Detection starts from the surface it
// is given, made under forces f0 of some earlier tick, and bounds how far a node can have moved since: with C
// symmetric positive definite, |u_i(f) - u_i(f0)| <= sqrt(tr C_ii) sqrt((f - f0).C(f - f0)) (Cauchy,
// Schwarz). What may be near by that bound is placed exactly, by rows of C, summed in an order that does not
// depend on the bound. So a tick's cost follows the number of contacts, and its bits do not depend on the
// surface's age.
#include <algorithm>
#include <cmath>

#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/contact/clusters.hpp"
#include "palpate/contact/solver.hpp"
#include "palpate/simulation/model.hpp"

namespace palpate {

namespace {

// Slots of the contact block for nodes that are near, but no contact points.
constexpr std::size_t spare_slots = 256;
// Of the elastic energy: what float32 may hide of (f - f0).C(f - f0).
constexpr double hidden = 1e-6;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// An instrument's motion against the organ since the last tick.
struct Sweep {
  Pose last;           // from the organ's frame to its own then
  bool known = false;  // otherwise it was put where it is
  double reach = 0;    // m: what was this near may have been passed through; 0: moved less than its thinness
};

}  // namespace

struct StepScratch {
  StepScratch(const Model& model, std::size_t most)
      : compliance(model.organ.compliance.with_work()),
        block(std::min(most + spare_slots, compliance.nodes()), compliance.nodes()),
        solver(most, block.capacity()),
        deformer(model.organ),
        capacity(most),
        compliance_rows(9 * most) {}

  // The model's own, in case another organ has been put into it since.
  const Compliance& compliance_of(const Model& model) const {
    return compliance.same_numbers(model.organ.compliance) ? compliance : model.organ.compliance;
  }

  Compliance compliance;  // the model's, with work space
  ContactBlock block;
  ContactSolver solver;
  Deformer deformer;
  std::size_t capacity;
  Clusters anchored;  // nodes that cannot move
  ClusterBounds rest_bounds, anchored_bounds;
  std::vector<PlacedShape> shapes;            // instruments in the organ's frame
  std::vector<Sweep> sweeps;                  // how each came there
  Loads before;                               // of the last tick
  std::vector<Index> before_slots;            // of its rows
  std::vector<ContactPoint> points;           // may touch in this tick
  std::vector<Index> point_of;                // [instrument * nodes + node], -1: not among the points
  std::vector<Index> candidates;              // nodes that may be near an instrument
  std::vector<Index> near;                    // all of this tick, each once
  std::vector<std::uint8_t> is_near;          // of each node: among `near`
  std::vector<Index> wanted, slots;           // rows for the contact block, and where they came
  std::vector<Vec3> u;                        // of each node, m; right under the loads of the same number:
  std::vector<std::uint64_t> u_number;        // of each node
  std::vector<Index> loaded;                  // slots of state.loads
  std::vector<float> compliance_rows;         // of a node without a slot
  std::vector<float> softness;                // of each node: Clusters::softness
  double drifted_before = 0;                  // from the surface to the last tick's loads, sqrt J
  double size = 0, tolerance = 0, reach = 0;  // m
};

void DeleteScratch::operator()(StepScratch* scratch) const noexcept { delete scratch; }

State make_state(const Model& model) {
  const Organ& organ = model.organ;
  const std::size_t s = organ.surface_size(), instruments = model.instruments.size();
  if (s == 0 || organ.compliance.nodes() == 0)
    throw Error(ErrorKind::usage, "the model's organ has no surface node that can move");
  if (model.settings.max_contacts < 1 || model.settings.max_contacts > 5000)
    throw Error(ErrorKind::usage, "max_contacts is {}; use 1 to 5000", model.settings.max_contacts);
  for (const Instrument& instrument : model.instruments)
    if (is_empty(instrument.shape))
      throw Error(ErrorKind::usage, "instrument '{}' has an empty lattice", instrument.name);

  const auto capacity = std::min<std::size_t>(static_cast<std::size_t>(model.settings.max_contacts),
                                              s * std::max<std::size_t>(instruments, 1));
  State state;
  state.surface = make_surface(organ);
  state.loads = Loads(s);
  state.contacts.reserve(std::max(capacity, s));
  state.wrenches.assign(instruments, Wrench{});
  state.scratch.reset(new StepScratch(model, capacity));
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
  w.before_slots.resize(s);
  state.placed.reserve(instruments);
  w.points.reserve(capacity);
  w.point_of.assign(s * instruments, -1);
  w.candidates.reserve(s);
  w.near.reserve(s);
  w.is_near.assign(s, 0);
  w.wanted.reserve(w.block.capacity());
  w.slots.resize(w.block.capacity());
  w.u.assign(s, Vec3::Zero());
  w.u_number.assign(s, 0);
  w.loaded.resize(s);
  w.size = bounding_box(organ.surface.vertices).diagonal();
  w.tolerance = model.settings.tolerance * w.size;
  double area = 0;
  for (const double a : organ.areas) area += a;
  w.softness.assign(s, 0.0f);
  for (std::size_t i = 0; i < state.surface.clusters->nodes.size(); ++i)
    w.softness[at(state.surface.clusters->nodes[i])] = state.surface.clusters->softness[i];
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
  bool ok = input.instruments.size() == model.instruments.size() && sensible(input.organ);
  for (const Pose& p : input.instruments) ok = ok && sensible(p);
  return ok;
}

Pose normalized(Pose p) {
  p.rotation.normalize();
  return p;
}

// The largest way of a corner of the shape's box since it was at `last`.
double motion(const Shape& shape, const Pose& last, const Pose& now) {
  const Box box = bounding_box(shape);
  double most = 0;
  for (int corner = 0; corner < 8 && box.max.allFinite() && box.min.allFinite(); ++corner) {
    const Vec3 p(corner & 1 ? box.max.x() : box.min.x(), corner & 2 ? box.max.y() : box.min.y(),
                 corner & 4 ? box.max.z() : box.min.z());
    most = std::max(most, (now * p - last * p).norm());
  }
  return most;
}

void place(const Model& model, State& state, const Input& input) {
  StepScratch& w = *state.scratch;
  const Pose to_organ = normalized(input.organ).inverse();
  const bool has_last = state.placed.size() == model.instruments.size() && state.loads.u_known;
  w.shapes.clear();
  for (std::size_t i = 0; i < model.instruments.size(); ++i) {
    const Shape& shape = model.instruments[i].shape;
    w.shapes.emplace_back(shape, to_organ * normalized(input.instruments[i]));
    w.sweeps[i] = {};
    if (!has_last) continue;
    const double moved = motion(shape, state.placed[i], w.shapes[i].to_organ);
    if (moved > largest_motion * w.size) continue;
    w.sweeps[i] = {state.placed[i].inverse(), true, moved > 0.5 * w.shapes[i].finest ? moved : 0.0};
  }
  state.placed.clear();
  for (const PlacedShape& shape : w.shapes) state.placed.push_back(shape.to_organ);
  w.before.copy(state.loads);
}

// Adds a node once an instrument; false when there is no room. u: now; path: how it came there.
bool add_point(const Model& model, StepScratch& w, Index node, std::size_t instrument, const Vec3& u,
               const Path& path, const Vec3& force = Vec3::Zero()) {
  Index& place = w.point_of[instrument * model.organ.surface_size() + at(node)];
  if (place >= 0) return true;
  if (w.points.size() >= w.capacity) return false;
  place = static_cast<Index>(w.points.size());
  ContactPoint c;
  c.node = node, c.row = model.organ.row_of[at(node)], c.instrument = static_cast<Index>(instrument);
  c.rest = model.organ.contact_points[at(node)];
  c.u = u;
  c.path = path;
  c.force = force;
  w.points.push_back(c);
  return true;
}

void forget_points(const Model& model, StepScratch& w) {
  for (const ContactPoint& c : w.points)
    w.point_of[at(c.instrument) * model.organ.surface_size() + at(c.node)] = -1;
  w.points.clear();
}

bool is_first(const Model& model, const StepScratch& w, const ContactPoint& c) {  // of its node's points
  for (Index other = 0; other < c.instrument; ++other)
    if (w.point_of[at(other) * model.organ.surface_size() + at(c.node)] >= 0) return false;
  return true;
}

// Gives slots in the contact block to the loads (while nodes are looked for) or to the points (when these are
// solved for), and to what is near while there is room.
enum class For { loads, points };
void hold(const Model& model, State& state, For what) {
  StepScratch& w = *state.scratch;
  w.wanted.clear();
  const auto want = [&](Index row) {
    if (w.wanted.size() < w.block.capacity()) w.wanted.push_back(row);
  };
  if (what == For::loads)
    for (std::size_t i = 0; i < state.loads.count; ++i) want(state.loads.rows[i]);
  else
    for (const ContactPoint& c : w.points)
      if (is_first(model, w, c)) want(c.row);  // no room for twice the same
  for (const Index node : w.near) want(model.organ.row_of[at(node)]);
  w.block.require(w.compliance_of(model), w.wanted, w.slots);
  for (std::size_t i = 0; i < state.loads.count; ++i) w.loaded[i] = w.block.slot_of(state.loads.rows[i]);
  for (std::size_t i = 0; i < w.before.count; ++i) w.before_slots[i] = w.block.slot_of(w.before.rows[i]);
  for (ContactPoint& c : w.points) c.slot = w.block.slot_of(c.row);
}

void forget_near(StepScratch& w) {
  for (const Index node : w.near) w.is_near[at(node)] = 0;
  w.near.clear();
}

// Displacement of a node under loads, whose slots are given, in float64.
Vec3 displacement(const Model& model, StepScratch& w, Index node, const Loads& loads,
                  std::span<const Index> slots) {
  const std::size_t n = loads.count;
  const Index row = model.organ.row_of[at(node)];
  const Index slot = w.block.slot_of(row);
  if (slot >= 0 && std::find(slots.begin(), slots.begin() + static_cast<std::ptrdiff_t>(n), -1) ==
                       slots.begin() + static_cast<std::ptrdiff_t>(n))
    return w.block.displacement(slot, slots.first(n), {loads.forces.data(), n});
  w.compliance_of(model).block({&row, 1}, {loads.rows.data(), n}, {w.compliance_rows.data(), 9 * n}, 3 * n);
  Vec3 u = Vec3::Zero();
  const float* c = w.compliance_rows.data();
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t r = 0; r < 3; ++r) {
      const float* e = c + 3 * n * r + 3 * k;
      const Vec3& f = loads.forces[k];
      u[static_cast<int>(r)] += static_cast<double>(e[0]) * f[0] + static_cast<double>(e[1]) * f[1] +
                                static_cast<double>(e[2]) * f[2];
    }
  return u;
}

// Under state.loads, which have slots.
const Vec3& displacement(const Model& model, State& state, Index node) {
  StepScratch& w = *state.scratch;
  Vec3& u = w.u[at(node)];
  if (w.u_number[at(node)] == state.loads.number) return u;
  w.u_number[at(node)] = state.loads.number;
  return u = displacement(model, w, node, state.loads, w.loaded);
}

// How the node came near the shape: where it was in the last tick.
Path path_of(const Model& model, State& state, std::size_t shape, Index node) {
  StepScratch& w = *state.scratch;
  const Sweep& sweep = w.sweeps[shape];
  if (!sweep.known) return {};
  const Vec3 u = state.loads.number == w.before.number
                     ? displacement(model, state, node)
                     : displacement(model, w, node, w.before, w.before_slots);
  return path_from(w.shapes[shape], sweep.last * Vec3(model.organ.contact_points[at(node)] + u));
}

// sqrt((f - f0).C(f - f0)) at most, sqrt J: f of state.loads, f0 of the surface.
double drift(const Model& model, State& state, const Surface& surface) {
  const Loads& then = surface.loads;
  if (then.number == state.loads.number) return 0;
  const double work = state.loads.work(), work_then = then.work();
  double both = 0;
  for (std::size_t i = 0; i < then.count; ++i)
    both += then.forces[i].dot(displacement(model, state, model.organ.node_of_row[at(then.rows[i])]));
  return std::sqrt(std::max(0.0, work - 2 * both + work_then) + hidden * (std::abs(work) + work_then));
}

// Whether a node that lies `d` off the shape on the lagging surface may come nearer than `near` to the shape
// on its way through this tick.
bool may_meet(const StepScratch& w, const Surface& surface, std::size_t instrument, Index node, double d,
              double near, double drifted) {
  const double clearance =
      near + static_cast<double>(w.softness[at(node)]) * std::max(drifted, w.drifted_before);
  if (d <= clearance) return true;
  const Vec3& p = surface.positions[at(node)];
  const PlacedShape& shape = w.shapes[instrument];
  return passes(*shape.shape, w.sweeps[instrument].last * p, shape.to_shape * p, clearance);
}

// Calls found(node, distance, u) for every free node nearer to the shape than `reach` under state.loads, or
// that the shape passed through.
template <class Found>
void near_now(const Model& model, State& state, const Surface& surface, std::size_t instrument, double reach,
              double drifted, Found&& found) {
  StepScratch& w = *state.scratch;
  const PlacedShape& shape = w.shapes[instrument];
  const Sweep& sweep = w.sweeps[instrument];
  w.candidates.clear();
  // The surface is float32: what it says is off by less than the tolerance.
  const double near = reach + w.tolerance;
  near_nodes(*surface.clusters, surface.bounds, surface.positions, shape, near + sweep.reach, drifted,
             [&](Index node, double d) {
               if (sweep.reach > 0 && !may_meet(w, surface, instrument, node, d, near, drifted)) return;
               w.candidates.push_back(node);
               if (!w.is_near[at(node)]) w.is_near[at(node)] = 1, w.near.push_back(node);
             });
  if (w.candidates.empty()) return;
  hold(model, state, For::loads);
  for (const Index node : w.candidates) {
    const Vec3& u = displacement(model, state, node);
    const Vec3 p = model.organ.contact_points[at(node)] + u;
    double d = shape.distance(p);
    if (d >= reach && sweep.reach > 0)
      d = std::min(d, gap_by_path(shape, path_of(model, state, instrument, node), p).distance);
    if (d < reach) found(node, d, u);
  }
}

// The nodes with a force in the last tick, and all nodes near an instrument where the surface is now.
void detect(const Model& model, State& state, const Surface& surface) {
  StepScratch& w = *state.scratch;
  forget_points(model, w);
  for (const Contact& c : state.contacts)
    if (c.instrument >= 0 && at(c.instrument) < w.shapes.size() && model.settings.mode == Mode::unilateral)
      if (add_point(model, w, c.node, at(c.instrument), displacement(model, state, c.node),
                    w.sweeps[at(c.instrument)].known ? path_from(w.shapes[at(c.instrument)], c.from) : Path{},
                    c.force_in_organ)) {
        ContactPoint& p =
            w.points[at(w.point_of[at(c.instrument) * model.organ.surface_size() + at(c.node)])];
        p.held = model.settings.friction > 0;
        p.reference = w.shapes[at(c.instrument)].to_organ * c.touched - p.rest;
      }
  const double drifted = w.drifted_before = drift(model, state, surface);
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    near_now(model, state, surface, i, w.reach, drifted, [&](Index node, double, const Vec3& u) {
      if (w.point_of[i * model.organ.surface_size() + at(node)] >= 0) return;
      if (!add_point(model, w, node, i, u, path_of(model, state, i, node))) state.status |= too_many_contacts;
    });
}

// Prescribed law: the nodes inside at rest, as in the thesis. A node belongs to the first instrument it is
// in.
void detect_at_rest(const Model& model, State& state, const Surface& surface) {
  StepScratch& w = *state.scratch;
  forget_points(model, w);
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    near_nodes(*surface.clusters, w.rest_bounds, model.organ.contact_points, w.shapes[i], 0.0, 0.0,
               [&](Index node, double) {
                 for (std::size_t other = 0; other < i; ++other)
                   if (w.point_of[other * model.organ.surface_size() + at(node)] >= 0) return;
                 if (!add_point(model, w, node, i, Vec3::Zero(), {})) state.status |= too_many_contacts;
               });
}

void see_anchored(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  for (const PlacedShape& shape : w.shapes)
    near_nodes(w.anchored, w.anchored_bounds, model.organ.contact_points, shape, -w.tolerance, 0.0,
               [&](Index, double) { state.status |= anchor_touched; });
}

// The points' forces become the loads; a node touched by two instruments is one.
void take_loads(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  Loads& loads = state.loads;
  loads.count = 0;
  ++loads.number;
  for (const ContactPoint& c : w.points) {
    w.u[at(c.node)] = c.u, w.u_number[at(c.node)] = loads.number;
    if (c.force == Vec3::Zero()) continue;
    std::size_t i = loads.count;
    if (!is_first(model, w, c))
      i = static_cast<std::size_t>(std::find(loads.rows.begin(),
                                             loads.rows.begin() + static_cast<std::ptrdiff_t>(loads.count),
                                             c.row) -
                                   loads.rows.begin());
    if (i == loads.count) loads.rows[loads.count] = c.row, loads.forces[loads.count++].setZero();
    loads.forces[i] += c.force, loads.u[i] = c.u;
  }
  loads.u_known = true;
  for (std::size_t i = 0; i < loads.count; ++i) w.loaded[i] = w.block.slot_of(loads.rows[i]);
}

// Nodes that were not among the points and lie inside an instrument now become points too. True when there
// were any.
bool add_swallowed(const Model& model, State& state, const Surface& surface) {
  StepScratch& w = *state.scratch;
  const std::size_t before = w.points.size(), s = model.organ.surface_size();
  const bool one_instrument_a_node = model.settings.mode == Mode::prescribed;
  const double drifted = drift(model, state, surface);
  state.deepest_after = 0;
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    near_now(model, state, surface, i, -w.tolerance, drifted, [&](Index node, double d, const Vec3& u) {
      const Index point = w.point_of[i * s + at(node)];
      state.deepest_after = std::max(state.deepest_after, point < 0 ? -d : -w.points[at(point)].gap);
      if (point >= 0) return;
      for (std::size_t other = 0; one_instrument_a_node && other < w.shapes.size(); ++other)
        if (w.point_of[other * s + at(node)] >= 0) return;
      if (!add_point(model, w, node, i, u, path_of(model, state, i, node))) state.status |= too_many_contacts;
    });
  return w.points.size() > before;
}

// Solves until no other node is swallowed by what the forces do.
void solve(const Model& model, State& state, const Surface& surface) {
  StepScratch& w = *state.scratch;
  SolverLimits limits{0.5 * w.tolerance, model.settings.max_relinearisations};
  SolveResult result;
  for (int round = 0; round < 10; ++round) {
    hold(model, state, For::points);
    if (!w.points.empty())
      result = model.settings.mode == Mode::prescribed
                   ? w.solver.prescribed(w.block, w.shapes, w.points, limits)
               : model.settings.friction > 0
                   ? w.solver.coulomb(w.block, w.shapes, w.points, model.settings.friction, limits)
                   : w.solver.unilateral(w.block, w.shapes, w.points, limits);
    else
      result.converged = true;
    state.relinearisations += result.relinearisations;
    limits.max_relinearisations -= result.relinearisations;
    take_loads(model, state);
    if (!add_swallowed(model, state, surface)) {
      if (!result.converged || state.deepest_after > w.tolerance) state.status |= not_converged;
      return;
    }
    if (limits.max_relinearisations <= 0) break;
  }
  state.status |= not_converged;
}

// A bell of force about the instrument's origin along its -z (T fig. 6.3): weight area * exp(-r^2 / 2
// radius^2), cut at 3 radii.
void gaussian(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  const Organ& organ = model.organ;
  const double radius = model.settings.gaussian_radius;
  Loads& loads = state.loads;
  loads.count = 0;
  loads.u_known = false;
  ++loads.number;
  state.contacts.clear();
  std::fill(w.loaded.begin(), w.loaded.end(), Index{-1});  // place of each node among the loads
  for (std::size_t i = 0; i < w.shapes.size(); ++i) {
    const PlacedShape& shape = w.shapes[i];
    const Vec3 centre = shape.to_organ.translation, direction = shape.to_organ.rotation * Vec3(0, 0, -1);
    const auto weight = [&](Index node) {
      const double r2 = (organ.contact_points[at(node)] - centre).squaredNorm() / (radius * radius);
      return r2 > 9 ? 0.0 : organ.areas[at(node)] * std::exp(-0.5 * r2);
    };
    double sum = 0;
    for (const Index node : organ.node_of_row) sum += weight(node);
    for (const Index node : organ.node_of_row) {
      const double share = sum > 0 ? weight(node) / sum : 0;
      if (share == 0) continue;
      const Vec3 force = share * model.settings.gaussian_force * direction;
      Index& place = w.loaded[at(node)];
      if (place < 0) {
        place = static_cast<Index>(loads.count++);
        loads.rows[at(place)] = organ.row_of[at(node)], loads.forces[at(place)].setZero();
      }
      loads.forces[at(place)] += force;
      if (state.contacts.size() == state.contacts.capacity()) continue;
      Contact c;
      c.node = node, c.instrument = static_cast<Index>(i);
      c.force_in_organ = force, c.force = state.organ.rotation * force;
      state.contacts.push_back(c);
    }
    const double given = sum > 0 ? model.settings.gaussian_force : 0;
    state.wrenches[i] = {state.organ.rotation * Vec3(-given * direction), {0, 0, 0}};
  }
}

// Nodes inside an instrument are moved onto its surface and stay there (T fig. 6.4).
void imprint(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  Surface& surface = state.surface;
  state.contacts.clear();
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    near_nodes(*surface.clusters, surface.bounds, surface.positions, w.shapes[i], -0.1 * w.tolerance, 0.0,
               [&](Index node, double d) {
                 const std::size_t n = at(node);
                 state.deepest_before = std::max(state.deepest_before, -d);
                 Vec3& p = surface.positions[n];
                 p = project_to_surface(w.shapes[i], p, 0.1 * w.tolerance);
                 surface.displacement[n] = surface.reading[n] =
                     (p - model.organ.contact_points[n]).cast<float>();
                 if (state.contacts.size() == state.contacts.capacity()) return;
                 Contact c;
                 c.node = node, c.instrument = static_cast<Index>(i), c.gap_before = d,
                 c.gap_after = w.shapes[i].distance(p);
                 state.contacts.push_back(c);
               });
  surface.bounds.update(*surface.clusters, surface.positions);
}

// Contacts in the world, and what the instruments feel.
void report(State& state, const Input& input) {
  StepScratch& w = *state.scratch;
  state.contacts.clear();
  for (Wrench& wrench : state.wrenches) wrench = {};
  for (const ContactPoint& p : w.points) {
    const PlacedShape& shape = w.shapes[at(p.instrument)];
    if (p.force == Vec3::Zero()) continue;
    Contact c;
    c.node = p.node, c.instrument = p.instrument;
    c.gap_before = shape.distance(p.rest);
    c.gap_after = p.gap;
    const Vec3 now = p.rest + p.u;
    Path gone;
    gap_by_path(shape, p.path, now, &gone);
    c.from = gone.known ? gone.from : Vec3(shape.to_shape * now);
    c.touched = shape.to_shape * (p.sticks ? Vec3(p.rest + p.reference) : now);
    c.force_in_organ = p.force, c.force = state.organ.rotation * p.force;
    state.contacts.push_back(c);
    state.deepest_before = std::max(state.deepest_before, -c.gap_before);
    Wrench& wrench = state.wrenches[at(p.instrument)];
    const Vec3 arm = state.organ * Vec3(p.rest + p.u) - input.instruments[at(p.instrument)].translation;
    wrench.force -= c.force;
    wrench.torque -= arm.cross(c.force);
    state.deepest_after = std::max(state.deepest_after, -c.gap_after);
  }
}

}  // namespace

void tick(const Model& model, State& state, const Input& input, const Surface& surface) noexcept {
  const Timer total = wall_timer();
  state.times = {};
  state.relinearisations = 0;
  if (!valid(model, input)) {
    state.status = bad_input;
    return;
  }
  state.status = status_ok;
  state.deepest_before = state.deepest_after = 0;
  state.organ = normalized(input.organ);
  place(model, state, input);
  forget_near(*state.scratch);
  if (!state.loads.u_known) state.loads.count = 0;  // another mode's
  switch (model.settings.mode) {
    case Mode::unilateral:
    case Mode::prescribed: {
      Timer timer = wall_timer();
      see_anchored(model, state);
      model.settings.mode == Mode::prescribed ? detect_at_rest(model, state, surface)
                                              : detect(model, state, surface);
      state.times.detect = timer.seconds();
      timer = wall_timer();
      solve(model, state, surface);
      report(state, input);
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

void step(const Model& model, State& state, const Input& input) noexcept {
  tick(model, state, input, state.surface);
  if (state.status & bad_input || model.settings.mode == Mode::imprint) return;
  const Timer timer = wall_timer();
  state.scratch->deformer(model.organ, state.loads, state.surface);
  if (state.surface.strains.beyond_linear()) state.status |= strain_beyond_linear;
  state.times.deform = timer.seconds();
  state.times.total += state.times.deform;
}

}  // namespace palpate
