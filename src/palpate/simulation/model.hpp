// What a simulation is made of: a Model that never changes while it runs, a State that is plain data, an
// Input a tick.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "palpate/contact/shape.hpp"
#include "palpate/simulation/surface.hpp"

namespace palpate {

struct Instrument {
  std::string name;
  Shape shape;           // in the instrument's frame
  TriangleMesh surface;  // for drawing, same frame
  // How thick it is where it touches, m: what is thinner than 0.8 of an edge of the organ's surface is felt
  // between its nodes, too (places.hpp). 0: the middle one of the sides of its box, as of a needle.
  double tip = 0;
};

enum class Mode : std::uint8_t {
  unilateral,  // gap >= 0, pressure >= 0, gap * pressure = 0 (default); Settings::friction
  prescribed,  // the thesis: touched nodes are moved onto the instrument's surface; may pull (T 4.3.2)
  gaussian,    // no collision: a bell of force about the instrument's origin, along its -z (T fig. 6.3)
  imprint      // no elasticity: touched nodes are moved onto the surface and stay (T fig. 6.4)
};
const char* name(Mode mode);
Mode parse_mode(const std::string& text);  // Error(usage) lists them

struct Settings {
  Mode mode = Mode::unilateral;
  double tolerance = 1e-6;  // of the gaps, relative to the organ's size (diagonal of its box)
  // A grasped node counts as three, a place between nodes too. Beyond it: status too_many_contacts, the rest
  // is left out.
  int max_contacts = 1000;
  // Of the gap function in a tick; beyond it: status not_converged, the next tick goes on.
  int max_relinearisations = 100;
  double friction = 0;            // Coulomb's coefficient between organ and instruments; mode unilateral
  double gaussian_force = 1;      // N, total
  double gaussian_radius = 0.01;  // m, standard deviation of the bell
};

struct Model {
  Organ organ;
  std::vector<Instrument> instruments;
  Settings settings;
};

struct Input {
  double time = 0;  // s, kept for the record; the statics do not use it
  Pose organ;       // of the anchor's frame: moving it moves the whole body without deforming it
  std::vector<Pose> instruments;         // one an instrument, world
  std::vector<std::uint8_t> grips = {};  // one an instrument, not 0: it grips (Grasp); or empty: none does
};

enum StatusBits : std::uint32_t {
  status_ok = 0,
  not_converged = 1,      // tolerance not reached within max_relinearisations
  too_many_contacts = 2,  // more than max_contacts; in modes gaussian and imprint, which have room for each
                          // surface node, only some are not in the list
  bad_input = 4,  // a pose that is no number or 1,000 km away, wrong number of poses or grips: the tick was
                  // skipped, the state kept
  anchor_touched =
      8,  // an instrument reaches into anchored nodes, which cannot give way; no force comes from there
  strain_beyond_linear = 16,  // a warning of deform(): the surface is strained by more than linear_strain
  jumped = 32  // an instrument moved by more than largest_motion and was put there: what lay on its way was
               // not touched
};

struct Contact {
  Index node = -1;  // surface node; of a place between nodes the nearest that can move
  Index instrument = -1;
  Index triangle = -1;          // a place: of the organ's surface; the force acts on its three nodes by
  Vec3 weights = Vec3::Zero();  // the place's barycentric coordinates
  Vec3 point = Vec3::Zero();    // where the force acts, m, world
  Vec3 force = Vec3::Zero();    // on the organ, N, world
  Vec3 force_in_organ = Vec3::Zero();  // the same in the organ's frame
  Vec3 touched = Vec3::Zero();  // where on the instrument it sticks or last slipped to, instrument frame, m
  Vec3 from =
      Vec3::Zero();       // where on the instrument it is, or if inside where it came in, instrument frame, m
  double gap_before = 0;  // m, of the node or place at rest: minus the penetration depth; deform() finds it
  double gap_after = 0;   // m, after the solve
  bool grasped = false;   // held by the instrument's grip; the force may pull
};

// A node that an instrument's grip holds (mode unilateral): it goes with the instrument, however that moves
// and turns, and no other instrument touches it. An instrument that grips and holds nothing grasps the nodes
// it presses on, at the end of a tick. It lets go of all when it no longer grips, and when it is put
// elsewhere (State::placed). What cannot be held, or is held already, is let go, too.
struct Grasp {
  Index node = -1;  // surface node
  Index instrument = -1;
  Vec3 place = Vec3::Zero();  // of the node, instrument frame, m
};

struct Wrench {
  Vec3 force = Vec3::Zero();   // on the instrument, N, world
  Vec3 torque = Vec3::Zero();  // about the instrument's origin, N m, world
};

// Seconds of each part of a tick, wall.
struct StepTimes {
  double detect = 0, solve = 0, deform = 0, total = 0;
};

// Work space and caches of step(); nothing in it decides a result. Allocated by make_state.
struct StepScratch;
struct DeleteScratch {
  void operator()(StepScratch* scratch) const noexcept;
};

// What came of a tick, for all who read it: a hand, a viewer, a recorder. Plain data, all of one moment.
struct Outcome {
  double time = 0;                // s, of the input
  Pose organ;                     // of the anchor's frame, world; and below: of the last input not bad
  std::vector<Pose> instruments;  // one an instrument, world
  std::vector<Contact> contacts;  // the nodes and places with a force
  std::vector<Wrench> wrenches;   // one an instrument: what its contacts do to it
  double deepest_before = 0;      // m, largest penetration at rest of a node with a force, >= 0; of deform()
  double deepest_after = 0;       // m, largest penetration left: the residual
  int relinearisations = 0;
  std::uint32_t status = status_ok;  // StatusBits
  StepTimes times;
};

struct State : Outcome {
  Surface surface;            // what step() makes of the loads; tick() leaves it alone
  Loads loads;                // of this tick: the contacts' forces as the compliance takes them
  std::vector<Grasp> grasps;  // that the next tick begins with
  // The instruments in the organ's frame in the last tick, from where the next one follows them; empty before
  // the first. An instrument that moves against the organ by more than a quarter of its size (largest_motion)
  // in one tick is put there: nothing was on its way.
  std::vector<Pose> placed;
  std::unique_ptr<StepScratch, DeleteScratch> scratch;
};

constexpr double largest_motion = 0.25;  // in a tick, of the diagonal of the organ's box

// Throws Error(usage | resource).
State make_state(const Model& model);
// One tick of forces: reads a surface that was made under this or an earlier tick's loads, and leaves loads,
// contacts and wrenches. Which surface it is does not change a bit of them. (Mode::imprint has no forces; it
// changes state.surface.) Never throws, allocates or locks.
void tick(const Model& model, State& state, const Input& input, const Surface& surface) noexcept;
// The surface under a tick's loads, and what it adds to the outcome: strain_beyond_linear, how deep contacts
// would be at rest, its time. Never throws, allocates or locks.
void deform(const Model& model, const Loads& loads, Deformer& deformer, Surface& surface,
            Outcome& outcome) noexcept;
// A tick, and the surface under it. Never throws, allocates or locks.
void step(const Model& model, State& state, const Input& input) noexcept;
// Deformed surface node in the world.
inline Vec3 deformed(const Model& model, const State& state, Index node) {
  return state.organ * (model.organ.surface.vertices[static_cast<std::size_t>(node)] +
                        state.surface.displacement[static_cast<std::size_t>(node)].cast<double>());
}
// What is drawn: the organ's drawing, or where it has none its surface.
const TriangleMesh& drawn_surface(const Organ& organ);
// Its vertices, deformed, in the world; pose: of the organ.
std::vector<Vec3> drawn_vertices(const Organ& organ, const Pose& pose, const Surface& surface);
inline std::vector<Vec3> drawn_vertices(const Model& model, const State& state) {
  return drawn_vertices(model.organ, state.organ, state.surface);
}
// Where the node's force acts, in the world: of linear tetrahedra the deformed node.
inline Vec3 contact_point(const Model& model, const State& state, Index node) {
  return state.organ * (model.organ.contact_points[static_cast<std::size_t>(node)] +
                        state.surface.reading[static_cast<std::size_t>(node)].cast<double>());
}

}  // namespace palpate
