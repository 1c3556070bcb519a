// Laws that need no solver: a force in the shape of a bell, and plastic dents.
#include <algorithm>
#include <cmath>

#include "palpate/simulation/tick_work.hpp"

namespace palpate {

namespace {

// Lists a contact, if there is room.
void list(State& state, const Contact& c) noexcept {
  if (state.contacts.size() == state.contacts.capacity())
    state.status |= too_many_contacts;
  else
    state.contacts.push_back(c);
}

}  // namespace

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
  std::fill(w.loaded.slots.begin(), w.loaded.slots.end(), Index{-1});  // place of each node among the loads
  for (std::size_t i = 0; i < w.shapes.size(); ++i) {
    const PlacedShape& shape = w.shapes[i];
    const Vec3 centre = shape.to_organ.translation, direction = shape.to_organ.rotation * Vec3(0, 0, -1);
    const auto weight = [&](Index node) {
      const double r2 = (organ.contact_points[at(node)] - centre).squaredNorm() / (radius * radius);
      return r2 > 9 ? 0.0 : organ.areas[at(node)] * std::exp(-0.5 * r2);
    };
    double sum = 0;
    for (const Index node : organ.node_of_row) sum += weight(node);
    const double given = sum > 0 ? model.settings.gaussian_force : 0;
    Wrench& wrench = state.wrenches[i];
    wrench = {state.organ.rotation * Vec3(-given * direction), Vec3::Zero()};
    for (const Index node : organ.node_of_row) {
      const double share = sum > 0 ? weight(node) / sum : 0;
      if (share == 0) continue;
      const Vec3 force = share * model.settings.gaussian_force * direction;
      Index& place = w.loaded.slots[at(node)];
      if (place < 0) {
        place = static_cast<Index>(loads.count++);
        loads.rows[at(place)] = organ.row_of[at(node)], loads.forces[at(place)].setZero();
      }
      loads.forces[at(place)] += force;
      const Vec3 point = state.organ * organ.contact_points[at(node)];  // at rest: where it goes is not known
      wrench.torque -= (point - state.instruments[i].translation).cross(state.organ.rotation * force);
      Contact c;
      c.node = node, c.instrument = static_cast<Index>(i);
      c.force_in_organ = force, c.force = state.organ.rotation * force;
      c.point = point;
      list(state, c);
    }
  }
}

// Nodes inside an instrument are moved onto its surface and stay there (T fig. 6.4).
void imprint(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  Surface& surface = state.surface;
  state.contacts.clear();
  for (std::size_t i = 0; i < w.shapes.size(); ++i)
    near_nodes(*surface.clusters, surface.bounds, surface.positions, w.shapes[i], -0.1 * w.tolerance,
               [&](Index node, double d) {
                 const std::size_t n = at(node);
                 state.deepest_before = std::max(state.deepest_before, -d);
                 Vec3& p = surface.positions[n];
                 p = project_to_surface(w.shapes[i], p, 0.1 * w.tolerance);
                 surface.displacement[n] = surface.reading[n] =
                     (p - model.organ.contact_points[n]).cast<float>();
                 Contact c;
                 c.node = node, c.instrument = static_cast<Index>(i), c.gap_before = d,
                 c.gap_after = w.shapes[i].distance(p), c.point = state.organ * p;
                 list(state, c);
               });
  surface.bounds.update(*surface.clusters, surface.positions);
  surface.loads.u_known = false;  // it is not what they do
}

}  // namespace palpate
