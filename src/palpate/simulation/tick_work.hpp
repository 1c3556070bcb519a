// What the parts of a tick share: step.cpp (the list), detect.cpp (what may touch), displacement.cpp (where
// nodes are), travel.cpp (how far they may have come), places.cpp (between nodes), predict.cpp (what a tick
// begins with), grip.cpp, modes.cpp (laws without a solver).
#pragma once

#include "palpate/contact/clusters.hpp"
#include "palpate/contact/solver.hpp"
#include "palpate/simulation/model.hpp"
#include "palpate/simulation/places.hpp"

namespace palpate {

// Nodes that are near, but no contact points: so many the contact block has a place for.
constexpr std::size_t most_watched = 2048;

// Of the elastic energy: what float32 may hide of (f - f0).C(f - f0).
constexpr double hidden = 1e-6;
// Ticks after which a point's displacement is summed up from all forces again, rather than from what changed.
constexpr std::uint64_t exact_every = 16;

inline std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// An instrument's motion against the organ since the last tick.
struct Sweep {
  Pose last;           // from the organ's frame to its own then
  bool known = false;  // otherwise it was put where it is
  double way = 0;      // m, the largest of a corner of its box
  double gone = 0;     // m, sum of the ways since the epoch began, when it was put where it is; an epoch of 0
  std::uint64_t epoch = 0;      // has no end: how far the instrument goes says nothing
  std::array<Vec3, 8> corners;  // where those of its box are, organ frame, m
  std::array<Vec3, 8> ways;     // and how each came there from where it was

  Sweep() noexcept { corners.fill(Vec3::Zero()), ways.fill(Vec3::Zero()); }
};

// How far nodes may have moved: travel.cpp.
struct Travel {
  double travelled = 0;       // sum of sqrt(df.C df) over all changes of the loads, sqrt J
  double come = 0;            // from the last tick's loads to the tick's own so far, sqrt J
  double come_at_most = 0;    // nodes that this may bring near are among `near`, sqrt J
  std::uint64_t changes = 0;  // of the loads
  double work = 0;            // df.C df of the last one, J; 0: not known, or not a whole tick's
  std::vector<float> planes;  // its df as the block takes it
  bool planes_known = false, smooth = false;  // smooth: like the one before, times a factor
  // How far at most all changes after one, and the last of them alone, move a node that this one moved by v:
  // by v along and sqrt(lambda(C_ii)) besides at most, m and sqrt J.
  struct Way {
    double along = 0, besides = 0;
  };
  struct Since {
    Way all, last{1, 0};
  };
  static constexpr std::uint64_t remembered = 64;
  std::array<Since, remembered> since;  // of the last changes
};

// How far a surface lags behind some loads: since it was made nodes have moved by at most their softness
// times `drifted`, sqrt J; or, as its own changes go on, so much along these and besides. And so by the last
// change of the loads alone.
struct Lag {
  double drifted = 0;
  struct Way {
    std::array<double, 2> along{};
    double besides = 0;  // sqrt J
    // Of the tolerance: a surface is float32, and so off by less than one, as is what changed since the one
    // before, and what of another change is besides by less than two.
    double off() const noexcept { return std::abs(along[0]) + 2 * std::abs(along[1]); }
  };
  Way all, last;
  std::array<double, 2> on_changes{};  // what the loads do where the surface's changes lead, J
};

struct StepScratch {
  StepScratch(const Model& model, std::size_t most, const Clusters& clusters)
      : compliance(model.organ.compliance.with_work()),
        block(std::min(most, compliance.nodes()), std::min(most_watched, compliance.nodes()),
              compliance.nodes(), std::min(most_places, most / 3)),
        solver(most, block.capacity(), block.plane()),
        deformer(model.organ),
        capacity(most),
        compliance_rows(9 * most),
        faces(model.organ, model.instruments, clusters) {}

  // Of a displacement that was read off the block: its last bits depend on the order of the slots, so it
  // holds only while they keep it. When it is asked for must not decide.
  std::uint64_t stamp(std::uint64_t number) const noexcept { return number + (block.moves() << 40); }

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
  std::vector<PlacedShape> shapes;  // instruments in the organ's frame
  std::vector<Sweep> sweeps;        // how each came there
  Loads before;                     // of the last tick
  Loads earlier;                    // of the one before
  std::vector<Index> earlier_of;    // of each row of the compliance: which of them it is, -1: none
  struct Begun {
    Vec3 u = Vec3::Zero();        // m
    std::uint64_t tick = 0;       // of all ticks
    std::uint64_t corrected = 0;  // the last tick in which its displacement was
  };
  std::vector<Begun> begun;  // of each node: what its point began the tick with
  std::vector<float> foreseen,
      foreseen_moved;  // of all loads, N, and what the points' part does, m; in planes
  double ahead = 0;    // the instruments' motion in this tick as a share of that in the last; 0: not known
  std::vector<ContactPoint> points;   // may touch in this tick
  std::vector<Path> paths;            // of state.contacts: how their points came to where they are
  std::vector<Index> point_of;        // [instrument * nodes + node], -1: not among the points
  std::vector<std::uint8_t> grasped;  // of each node: among the points, in a grip
  std::vector<Index> candidates;      // nodes that may be near an instrument
  // Nodes that are near an instrument, and foreseen not to touch it.
  std::vector<std::pair<Index, std::size_t>> held_back;
  std::vector<Index> near;              // all of this tick, each once
  std::vector<std::uint8_t> is_near;    // of each node: among `near`
  std::vector<Index> wanted;            // rows for the contact block
  std::vector<Vec3> u;                  // of each node, m; right under the loads of the same number:
  std::vector<std::uint64_t> u_number;  // of each node
  // How far from an instrument each node was when it was last looked at: most that are near need not be
  // placed in a tick, as they cannot have come nearer since by more than both have travelled.
  struct Clear {
    double distance = 0;       // m, plus what the instrument had gone by then
    std::uint64_t epoch = 0;   // of the sweep then
    double travelled = 0;      // then, sqrt J
    std::uint64_t change = 0;  // the last of the loads by then
    double speed = 0;          // how far that had moved the node, m; infinite: not known
  };
  std::vector<Clear> clear;  // [instrument * nodes + node]
  // Where each node was when it was last placed, and so where the changes of the loads since lead it.
  struct Placed {
    Vec3 u = Vec3::Zero(), change = Vec3::Zero();  // m; by the last change of the loads by then
    std::uint64_t last = 0;                        // which that was
    bool known = false;
  };
  std::vector<Placed> placed;  // of each node
  Travel travel;
  // Loads as the block takes them.
  struct Spread {
    std::vector<Index> slots;
    std::vector<float> planes;
    bool loadable = false;  // all of them
  };
  Spread loaded, loaded_before, loaded_earlier;  // state.loads, before, earlier
  std::vector<float> compliance_rows;            // of a node without a slot
  std::vector<float> softness;                   // of each node: Clusters::softness
  Faces faces;
  int round = 0;                               // of the tick's solves
  std::size_t places = 0;                      // among the points
  std::vector<std::vector<Index>> near_faces;  // of each instrument: triangles it may reach into
  std::vector<LookedAt> looked_at;             // [instrument * faces + triangle]
  std::vector<Vec3> u_before;                  // of each node under the last tick's loads, m; right in
  std::vector<std::uint64_t> u_before_number;  // the tick of the same number:
  struct Seen {
    Vec3 u = Vec3::Zero(), change = Vec3::Zero();  // m
    double share = 1;
    std::uint64_t round = 0;  // of all ticks
  };
  std::vector<Seen> seen;  // of each node: where the places' planes are taken
  std::uint64_t ticks = 0;
  Mode mode = Mode::unilateral;  // of the last tick
  bool moved_forces = false;  // forces have moved or gone without the solver since the points were displaced
  std::vector<Index> point_slots;             // of the points with a force
  std::vector<Vec3> point_forces;             // and these, N
  std::vector<double> placed_u;               // of each slot, in planes
  double left = 0;                            // m: how deep instruments reach into triangles after a solve
  std::vector<std::uint8_t> is_wanted;        // of each row: in hold(), let_go()
  double softest = 0;                         // the largest softness
  Lag lag, lag_before;                        // behind state.loads, and behind the last tick's
  double size = 0, tolerance = 0, reach = 0;  // m
};

// How far an instrument, and tissue by so much, have come in this tick, m: what was this near may have been
// passed through; 0: less than its thinness.
inline double way_through(const StepScratch& w, std::size_t instrument, double tissue = 0) {
  const Sweep& s = w.sweeps[instrument];
  const double way = s.way + tissue;
  return s.known && way > 0.5 * w.shapes[instrument].finest ? way : 0.0;
}

inline Pose normalized(Pose p) {
  p.rotation.normalize();
  return p;
}

// detect.cpp

// Puts the instruments where the outcome says, and remembers how they came there.
void place(const Model& model, State& state);
void forget_near(StepScratch& w);
void add_near(StepScratch& w, Index node);
// Whether there is room for so many more points; a place counts as three.
bool has_room(const StepScratch& w, std::size_t more);
// Whether no other point of the same node comes before this one.
bool is_first(const Model& model, const StepScratch& w, const ContactPoint& c);
// Whether no other instrument has a point of the same node.
bool is_alone(const Model& model, const StepScratch& w, const ContactPoint& c);
// The nodes with a force in the last tick, and all nodes near an instrument where the surface is now.
void detect(const Model& model, State& state, const Surface& surface);
// The nodes that detect() held back become points. True when there were any.
bool add_held_back(const Model& model, State& state);
// Prescribed law: the nodes inside at rest, as in the thesis. A node belongs to the first instrument it is
// in.
void detect_at_rest(const Model& model, State& state, const Surface& surface);
void see_anchored(const Model& model, State& state);
// Nodes that were not among the points and lie inside an instrument now become points too. True when there
// were any.
bool add_swallowed(const Model& model, State& state, const Surface& surface);

// displacement.cpp

// Gives slots in the contact block to the points and the loads.
void hold(const Model& model, State& state);
// The loads as the block takes them now.
void spread(StepScratch& w, const Loads& loads, StepScratch::Spread& spread);
// Of a node that can move, m: under state.loads, which have slots; under the last tick's. Their bits do not
// depend on what is watched.
const Vec3& displacement(const Model& model, State& state, Index node);
Vec3 displacement_before(const Model& model, State& state, Index node);
// Under state.loads to rounding: enough to tell that a node is far.
Vec3 displacement_about(const Model& model, State& state, Index node);
// All of the node's records.
void found_displacement(StepScratch& w, Index node, const Vec3& u, std::uint64_t number);
// displacement_about(), and what the last change of the loads did to the node, infinite: not known; with one
// row of C for both where it can be, m.
std::array<Vec3, 2> place_about(const Model& model, State& state, Index node);

// travel.cpp

// sqrt((f - f0).C(f - f0)) at most, sqrt J: f of state.loads, f0 of `then`.
double drift(const Model& model, State& state, const Loads& then);
double drift(const Model& model, const State& state, const Surface& surface);
// Of the surface behind state.loads. earlier: the loads before these; come: how far these have come since,
// sqrt J.
Lag lag_of(const Model& model, const State& state, const Surface& surface, const Loads& earlier, double come);
// The same after one more change of the loads.
Lag lag_after(const Model& model, const State& state, const Surface& surface, const Lag& lag, double come);
// After a solve, whose loads are spread: what changed of them adds to what any node may have moved.
// whole: a tick's first, that the solver alone made.
void travel(const Model& model, State& state, bool whole);
// Loads that did not come of those before.
void forget_changes(Travel& travel);
// Where the node is expected to be under state.loads, from where it was last placed, and how far off that may
// be at most, m; infinite: not known.
struct Expected {
  Vec3 u, change;  // m; by the last change of the loads
  double off, off_change;
};
Expected expected(const StepScratch& w, Index node);
// The same, or from where it is on the surface, whichever tells more.
Expected expected(const StepScratch& w, const Surface& surface, Index node);
// How far a node may have come in this tick, m.
double come_at_most(const StepScratch& w, Index node, const Expected& there);
// That the node is no nearer to the instrument now, under state.loads, m.
void remember(StepScratch& w, std::size_t instrument, Index node, double distance, const Expected& there);
// Of a node from an instrument, under state.loads: the distance is no less, m.
double clearance(const StepScratch& w, std::size_t instrument, Index node);

// places.cpp

// Where a place on a triangle is at rest, m.
inline Vec3 rest_at(const Organ& organ, std::size_t triangle, const Vec3& weights) {
  Vec3 rest = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k)
    rest += weights[static_cast<int>(k)] * organ.contact_points[at(organ.surface.triangles[triangle][k])];
  return rest;
}
// A place on a triangle, without displacement, path and force.
ContactPoint place_at(const Model& model, const StepScratch& w, std::size_t triangle, std::size_t instrument,
                      const Vec3& weights);
// The same between nodes: what is thicker than the way goes through nothing.
inline double way_between(const StepScratch& w, std::size_t instrument, double tissue = 0) {
  const double way = way_through(w, instrument, tissue);
  return way > w.faces.thickness[instrument] ? way : 0.0;
}
// Triangles an instrument may come to reach into in this tick, under displacements that drift so far from the
// surface; their nodes are near.
void find_faces(const Model& model, State& state, const Surface& surface, std::size_t instrument,
                double drifted);
// Takes the planes that stand for the instruments at the places, where these are now.
void face_places(const Model& model, State& state);
// Where forces have moved or gone without the solver, the points' displacements under those there are; after
// hold(): the solver goes on from there.
void displace_points(State& state);
// Where there are many, places without a force are points no more; those that are needed are found again.
void drop_idle_places(const Model& model, State& state);
// Where instruments now reach into triangles the deepest points become points. True when there were any, or
// when places with a force are off the planes that stood for the instruments, so that these should be taken
// again. early: before the tick's first solve, which will move what lies on the instrument.
bool add_places(const Model& model, State& state, const Surface& surface, bool early = false);

// predict.cpp

// What the last two ticks lead the points' forces to. False: nothing is known.
bool predict(const Model& model, State& state);
// Without friction, grips and instruments that need places: where a point is depends on the forces alone, not
// on how it came there.
bool foreseeable(const Model& model, const State& state);
// After predict(): what the foreseen forces do to the points. False: not known.
bool foresee(const Model& model, State& state);

// grip.cpp

// Before the forces: grips that opened, or whose instrument was put elsewhere, hold nothing any more; nor
// does one hold what is no node that can move, or is held already.
void let_go(const Model& model, State& state, const Input& input);
// After the forces: instruments that grip and hold nothing grasp what they press on.
void grasp(const Model& model, State& state, const Input& input);

// modes.cpp

void gaussian(const Model& model, State& state);
void imprint(const Model& model, State& state);

}  // namespace palpate
