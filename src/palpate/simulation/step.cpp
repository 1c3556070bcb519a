// One tick: place, detect, solve, deform, report. T 4.2 (detection), 4.3.2 (forces from displacements), 5.2.
#include <algorithm>
#include <cmath>

#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/contact/clusters.hpp"
#include "palpate/contact/solver.hpp"
#include "palpate/simulation/model.hpp"

namespace palpate {

struct StepScratch {
  StepScratch(const Model& model, std::size_t most)
      : compliance(model.organ.compliance.with_work()),
        solver(most, compliance.nodes()),
        capacity(most),
        positions(model.organ.contact_points),
        means(model.organ.projection.rows(), Eigen::Vector4f::Zero()),
        drawn(means.size()),
        work(2 * means.size()) {}

  // The model's own, in case another organ has been put into it since.
  const Compliance& compliance_of(const Model& model) const {
    return compliance.same_numbers(model.organ.compliance) ? compliance : model.organ.compliance;
  }

  Compliance compliance;  // the model's, with work space
  ContactSolver solver;
  std::size_t capacity;
  Clusters free, anchored;      // nodes that can move, and those that cannot
  std::vector<Vec3> positions;  // deformed contact points, organ frame, m
  std::vector<ClusterBall> rest_balls, balls, anchored_balls;
  Box rest_box, box, anchored_box;
  std::vector<PlacedShape> shapes;                  // instruments in the organ's frame
  std::vector<ContactPoint> points;                 // may touch in this tick
  std::vector<Index> point_of;                      // [instrument * nodes + node], -1: not among the points
  std::vector<Index> rows;                          // of the nodes with forces
  std::vector<float> forces, u;                     // 3 a row
  std::vector<Eigen::Vector4f> means, drawn, work;  // for the projection onto the surface nodes
  double size = 0, tolerance = 0, reach = 0;        // m
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
  state.scratch.reset(new StepScratch(model, capacity));
  StepScratch& w = *state.scratch;
  std::vector<Index> anchored;
  for (std::size_t i = 0; i < s; ++i)
    if (organ.row_of[i] < 0) anchored.push_back(static_cast<Index>(i));
  w.free = Clusters(organ.contact_points, organ.node_of_row);
  w.anchored = Clusters(organ.contact_points, anchored);
  w.rest_balls.resize(w.free.size());
  w.anchored_balls.resize(w.anchored.size());
  w.rest_box = w.box = bound_clusters(w.free, organ.contact_points, w.rest_balls);
  w.anchored_box = bound_clusters(w.anchored, organ.contact_points, w.anchored_balls);
  w.balls = w.rest_balls;
  w.shapes.reserve(instruments);
  w.points.reserve(w.capacity);
  w.point_of.assign(s * instruments, -1);
  w.rows.reserve(s);
  w.forces.reserve(3 * s);
  w.u.assign(3 * organ.compliance.nodes(), 0.0f);
  w.size = bounding_box(organ.surface.vertices).diagonal();
  w.tolerance = model.settings.tolerance * w.size;
  double area = 0;
  for (const double a : organ.areas) area += a;
  w.reach = 0.25 * std::sqrt(area / static_cast<double>(s));
  state.displacement.assign(s, Vec3f::Zero());
  state.reading = state.displacement;
  state.contacts.reserve(std::max(w.capacity, s));
  state.wrenches.assign(instruments, Wrench{});
  return state;
}

namespace {

bool finite(const Pose& p) {
  return p.translation.allFinite() && p.rotation.coeffs().allFinite() &&
         std::abs(p.rotation.norm() - 1) < 1e-3;
}

bool valid(const Model& model, const Input& input) {
  bool ok = input.instruments.size() == model.instruments.size() && finite(input.organ);
  for (const Pose& p : input.instruments) ok = ok && finite(p);
  return ok;
}

Pose normalized(Pose p) {
  p.rotation.normalize();
  return p;
}

void place(const Model& model, StepScratch& w, const Input& input) {
  const Pose to_organ = normalized(input.organ).inverse();
  w.shapes.clear();
  for (std::size_t i = 0; i < model.instruments.size(); ++i)
    w.shapes.emplace_back(model.instruments[i].shape, to_organ * normalized(input.instruments[i]));
}

// Adds a node once an instrument; false when there is no room.
bool add_point(const Model& model, const State& state, StepScratch& w, Index node, std::size_t instrument,
               const Vec3& force = Vec3::Zero()) {
  const auto n = static_cast<std::size_t>(node);
  Index& place = w.point_of[instrument * model.organ.surface_size() + n];
  if (place >= 0) return true;
  if (w.points.size() >= w.capacity) return false;
  place = static_cast<Index>(w.points.size());
  ContactPoint c;
  c.node = node, c.row = model.organ.row_of[n], c.instrument = static_cast<Index>(instrument);
  c.rest = model.organ.contact_points[n];
  c.u = state.reading[n].cast<double>();
  c.force = force;
  w.points.push_back(c);
  return true;
}

void forget_points(const Model& model, StepScratch& w) {
  for (const ContactPoint& c : w.points)
    w.point_of[static_cast<std::size_t>(c.instrument) * model.organ.surface_size() +
               static_cast<std::size_t>(c.node)] = -1;
  w.points.clear();
}

// The nodes with a force in the last tick, and all nodes near an instrument where the surface is now.
void detect(const Model& model, State& state, const Eigen::Quaterniond& last_frame) {
  StepScratch& w = *state.scratch;
  forget_points(model, w);
  for (const Contact& c : state.contacts)
    if (c.instrument >= 0 && static_cast<std::size_t>(c.instrument) < w.shapes.size() &&
        model.settings.mode == Mode::unilateral)
      add_point(model, state, w, c.node, static_cast<std::size_t>(c.instrument),
                last_frame.conjugate() * c.force);
  for (std::size_t i = 0; i < w.shapes.size(); ++i) {
    near_nodes(w.free, w.balls, w.box, w.positions, w.shapes[i], w.reach, [&](Index node, double) {
      if (!add_point(model, state, w, node, i)) state.status |= too_many_contacts;
    });
    near_nodes(w.anchored, w.anchored_balls, w.anchored_box, w.positions, w.shapes[i], -w.tolerance,
               [&](Index, double) { state.status |= anchor_touched; });
  }
}

// Prescribed law: the nodes inside at rest, as in the thesis. A node belongs to the first instrument it is
// in.
void detect_at_rest(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  forget_points(model, w);
  std::fill(state.reading.begin(), state.reading.end(), Vec3f::Zero());
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    near_nodes(w.free, w.rest_balls, w.rest_box, model.organ.contact_points, w.shapes[i], 0.0,
               [&](Index node, double) {
                 for (std::size_t other = 0; other < i; ++other)
                   if (w.point_of[other * model.organ.surface_size() + static_cast<std::size_t>(node)] >= 0)
                     return;
                 if (!add_point(model, state, w, node, i)) state.status |= too_many_contacts;
               });
}

// What C f says of the contact points, and where they are now.
void take_up(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  const Organ& organ = model.organ;
  for (std::size_t r = 0; r < organ.compliance.nodes(); ++r) {
    const auto node = static_cast<std::size_t>(organ.node_of_row[r]);
    const Vec3f u(w.u[3 * r], w.u[3 * r + 1], w.u[3 * r + 2]);
    state.reading[node] = u;
    w.positions[node] = organ.contact_points[node] + u.cast<double>();
  }
}

// The surface nodes' displacement from what was read at the contact points.
void project(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  const Organ& organ = model.organ;
  if (organ.order == 1) {
    std::copy(state.reading.begin(), state.reading.end(), state.displacement.begin());
    return;
  }
  for (std::size_t r = 0; r < w.means.size(); ++r)
    w.means[r].head<3>() = state.reading[static_cast<std::size_t>(organ.node_of_row[r])];
  organ.projection(w.means, w.drawn, w.work);
  for (std::size_t r = 0; r < w.means.size(); ++r)
    state.displacement[static_cast<std::size_t>(organ.node_of_row[r])] = w.drawn[r].head<3>();
}

// u = C f on the whole surface.
void deform(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  w.rows.clear();
  w.forces.clear();
  for (const ContactPoint& c : w.points) {
    if (c.force == Vec3::Zero()) continue;
    w.rows.push_back(c.row);
    for (int a = 0; a < 3; ++a) w.forces.push_back(static_cast<float>(c.force[a]));
  }
  w.compliance_of(model).apply(w.rows, w.forces, w.u);
  for (const ContactPoint& c : w.points)  // these are known in float64
    for (int a = 0; a < 3; ++a)
      w.u[3 * static_cast<std::size_t>(c.row) + static_cast<std::size_t>(a)] = static_cast<float>(c.u[a]);
  take_up(model, state);
  w.box = bound_clusters(w.free, w.positions, w.balls);
}

// Nodes that were not among the points and lie inside an instrument now become points too. True when there
// were any.
bool add_swallowed(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  const std::size_t before = w.points.size();
  state.deepest_after = 0;
  const bool one_instrument_a_node = model.settings.mode == Mode::prescribed;
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    near_nodes(w.free, w.balls, w.box, w.positions, w.shapes[i], -w.tolerance, [&](Index node, double d) {
      state.deepest_after = std::max(state.deepest_after, -d);
      for (std::size_t other = 0; one_instrument_a_node && other < w.shapes.size(); ++other)
        if (w.point_of[other * model.organ.surface_size() + static_cast<std::size_t>(node)] >= 0) return;
      if (!add_point(model, state, w, node, i)) state.status |= too_many_contacts;
    });
  return w.points.size() > before;
}

// Solve and deform until no other node is swallowed by what the forces do.
void solve_and_deform(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  const SolverLimits limits{0.5 * w.tolerance, model.settings.max_relinearisations};
  const Compliance& compliance = w.compliance_of(model);
  SolveResult result;
  for (int round = 0; round < 10; ++round) {
    const Timer solving = wall_timer();
    if (!w.points.empty())
      result = model.settings.mode == Mode::prescribed
                   ? w.solver.prescribed(compliance, w.shapes, w.points, limits)
                   : w.solver.unilateral(compliance, w.shapes, w.points, limits);
    else
      result.converged = true;
    state.relinearisations += result.relinearisations;
    state.times.solve += solving.seconds();
    const Timer deforming = wall_timer();
    deform(model, state);
    const bool more = add_swallowed(model, state);
    state.times.deform += deforming.seconds();
    if (!more) {
      if (!result.converged || state.deepest_after > w.tolerance) state.status |= not_converged;
      return;
    }
  }
  state.status |= not_converged;
}

// A bell of force about the instrument's origin along its -z (T fig. 6.3): weight area * exp(-r^2 / 2
// radius^2), cut at 3 radii.
void gaussian(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  const double radius = model.settings.gaussian_radius;
  w.rows.clear();
  w.forces.clear();
  for (const PlacedShape& shape : w.shapes) {
    const Vec3 centre = shape.to_organ.translation, direction = shape.to_organ.rotation * Vec3(0, 0, -1);
    const auto first = static_cast<std::ptrdiff_t>(w.rows.size());
    double sum = 0;
    for (const Index node : w.free.nodes) {
      const auto n = static_cast<std::size_t>(node);
      const double r2 = (model.organ.contact_points[n] - centre).squaredNorm() / (radius * radius);
      if (r2 > 9 || w.rows.size() >= static_cast<std::size_t>(w.rows.capacity())) continue;
      const double weight = model.organ.areas[n] * std::exp(-0.5 * r2);
      sum += weight;
      w.rows.push_back(model.organ.row_of[n]);
      for (int a = 0; a < 3; ++a) w.forces.push_back(static_cast<float>(weight * direction[a]));
    }
    for (auto f = w.forces.begin() + 3 * first; f != w.forces.end(); ++f)
      *f *= static_cast<float>(sum > 0 ? model.settings.gaussian_force / sum : 0.0);
  }
  w.compliance_of(model).apply(w.rows, w.forces, w.u);
  state.contacts.clear();
  for (std::size_t i = 0; i < w.rows.size(); ++i) {
    Contact c;
    c.node = model.organ.node_of_row[static_cast<std::size_t>(w.rows[i])];
    c.instrument = 0;
    c.force = state.organ.rotation *
              Vec3f(w.forces[3 * i], w.forces[3 * i + 1], w.forces[3 * i + 2]).cast<double>();
    state.contacts.push_back(c);
  }
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    state.wrenches[i] = {
        state.organ.rotation * (w.shapes[i].to_organ.rotation * Vec3(0, 0, model.settings.gaussian_force)),
        Vec3::Zero()};
  take_up(model, state);
  project(model, state);
}

// Nodes inside an instrument are moved onto its surface and stay there (T fig. 6.4).
void imprint(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  state.contacts.clear();
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    near_nodes(w.free, w.balls, w.box, w.positions, w.shapes[i], -0.1 * w.tolerance,
               [&](Index node, double d) {
                 const auto n = static_cast<std::size_t>(node);
                 state.deepest_before = std::max(state.deepest_before, -d);
                 w.positions[n] = project_to_surface(w.shapes[i], w.positions[n], 0.1 * w.tolerance);
                 state.displacement[n] = state.reading[n] =
                     (w.positions[n] - model.organ.contact_points[n]).cast<float>();
                 if (state.contacts.size() == state.contacts.capacity()) return;
                 Contact c;
                 c.node = node, c.instrument = static_cast<Index>(i), c.gap_before = d,
                 c.gap_after = w.shapes[i].distance(w.positions[n]);
                 state.contacts.push_back(c);
               });
  w.box = bound_clusters(w.free, w.positions, w.balls);
}

// Contacts in the world, and what the instruments feel.
void report(State& state, const Input& input) {
  StepScratch& w = *state.scratch;
  state.contacts.clear();
  for (Wrench& wrench : state.wrenches) wrench = {};
  for (const ContactPoint& p : w.points) {
    const PlacedShape& shape = w.shapes[static_cast<std::size_t>(p.instrument)];
    const double before = shape.distance(p.rest);
    state.deepest_before = std::max(state.deepest_before, -before);
    if (p.force == Vec3::Zero()) continue;
    Contact c;
    c.node = p.node, c.instrument = p.instrument, c.gap_before = before;
    c.gap_after = shape.distance(w.positions[static_cast<std::size_t>(p.node)]);
    c.force = state.organ.rotation * p.force;
    state.contacts.push_back(c);
    Wrench& wrench = state.wrenches[static_cast<std::size_t>(p.instrument)];
    const Vec3 arm = state.organ * w.positions[static_cast<std::size_t>(p.node)] -
                     input.instruments[static_cast<std::size_t>(p.instrument)].translation;
    wrench.force -= c.force;
    wrench.torque -= arm.cross(c.force);
    state.deepest_after = std::max(state.deepest_after, -c.gap_after);
  }
}

}  // namespace

void step(const Model& model, State& state, const Input& input) noexcept {
  const Timer total = wall_timer();
  state.times = {};
  state.relinearisations = 0;
  if (!valid(model, input)) {
    state.status = bad_input;
    return;
  }
  state.status = status_ok;
  state.deepest_before = state.deepest_after = 0;
  const Eigen::Quaterniond last_frame = state.organ.rotation;
  state.organ = normalized(input.organ);
  place(model, *state.scratch, input);
  switch (model.settings.mode) {
    case Mode::unilateral:
    case Mode::prescribed: {
      const Timer detecting = wall_timer();
      model.settings.mode == Mode::prescribed ? detect_at_rest(model, state)
                                              : detect(model, state, last_frame);
      state.times.detect = detecting.seconds();
      solve_and_deform(model, state);
      const Timer drawing = wall_timer();
      project(model, state);
      state.times.deform += drawing.seconds();
      report(state, input);
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

}  // namespace palpate
