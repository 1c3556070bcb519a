// Contact forces between an organ and rigid shapes, on the nodes that may touch. Both laws linearise the gap
// at the deformed positions again and again until gap and force agree, so contact geometry is right at depth
// while the material stays linear. Signorini contact by successive linearisation: Wriggers, Computational
// Contact Mechanics (2006), ch. 5 and 9; forces by Green's functions: James, Pai, "ArtDefo" (1999); Duriez et
// al., "Realistic haptic rendering of interacting deformable objects" (2006).
#pragma once

#include <span>
#include <vector>

#include "palpate/contact/clusters.hpp"
#include "palpate/contact/complementarity.hpp"
#include "palpate/contact/contact_block.hpp"
#include "palpate/contact/normal_compliance.hpp"
#include "palpate/contact/path.hpp"

namespace palpate {

// A node that may touch a shape. Organ frame. A grasped node is three points, one for each axis, which is
// their normal: their displacement along it is given (`reference`), their pressure may pull.
struct ContactPoint {
  Index node = -1;  // surface node; of a place the nearest that can move
  Index row = -1;   // its row in the compliance
  Index instrument = -1;
  Index slot = -1;              // in the contact block; the caller's to set
  Index triangle = -1;          // a place: of the surface, on whose three nodes it rides
  Vec3 weights = Vec3::Zero();  // its barycentric coordinates there
  // What is finer than a triangle meets it as a tip meets a plane: the force goes along the triangle's
  // normal, as a tip has none of its own, or one that turns within a fraction of the triangle. So a place's
  // gap is linear in u until the caller looks again: offset + tilt facing.u.
  Vec3 facing = Vec3::Zero();      // into the organ, unit
  double offset = 0, tilt = 0;     // m; -
  Vec3 rest = Vec3::Zero();        // position at rest, m
  Vec3 u = Vec3::Zero();           // displacement, m: in, the last tick's; out, the solution's
  Vec3 normal = Vec3::Zero();      // direction of the force, unit
  double gap = 0;                  // m, at rest + u
  double slope = 1;                // of the gap along the normal
  double pressure = 0;             // N along the normal: in, the last tick's; out, the solution's
  Vec3 force = Vec3::Zero();       // N, on the organ
  Vec3 foreseen = Vec3::Zero();    // N: in, a guess of how it will change in this tick,
  Vec3 foreseen_u = Vec3::Zero();  // m: and what that does
  // Friction: whether the point touched before, and its displacement if it has not slipped since, m.
  bool held = false;
  Vec3 reference = Vec3::Zero();
  bool sticks = false;   // out: friction below its limit
  bool grasped = false;  // then `reference` is the displacement
  Path path;             // in, how it comes to where it is; out, when it is there
};

// From the point, displaced by u, to its instrument, by its path.
inline Gap gap_of(std::span<const PlacedShape> shapes, const ContactPoint& c, const Vec3& u,
                  Path* gone = nullptr) noexcept {
  if (c.grasped) return {c.normal.dot(u - c.reference), c.normal, 1};
  if (c.triangle >= 0) return {c.offset + c.tilt * c.facing.dot(u), c.facing, c.tilt};
  return gap_by_path(shapes[static_cast<std::size_t>(c.instrument)], c.path, c.rest + u, gone);
}
// Of many points, each at at_of(its number), by the distance fields alone: runs of one instrument at once.
// own: the points in their instruments' frames.
template <class Where>
void field_gaps(std::span<const PlacedShape> shapes, std::span<const ContactPoint> points, Where&& at_of,
                std::span<Vec3> own, std::span<Gap> out) noexcept {
  for (std::size_t first = 0, end = 0; first < points.size(); first = end) {
    const PlacedShape& shape = shapes[static_cast<std::size_t>(points[first].instrument)];
    for (; end < points.size() && points[end].instrument == points[first].instrument; ++end)
      own[end] = shape.own(at_of(end));
    gaps(*shape.shape, own.subspan(first, end - first), out.subspan(first));
  }
}
inline double distance_of(std::span<const PlacedShape> shapes, const ContactPoint& c,
                          const Vec3& u) noexcept {
  return gap_of(shapes, c, u).distance;
}

// What a point's pressure begins with, N.
inline double start_of(const ContactPoint& c, const Vec3& force) noexcept {
  const double p = c.normal.dot(force);
  return c.grasped ? p : std::max(0.0, p);
}

struct SolverLimits {
  double tolerance = 0;  // m, of the gaps
  int max_relinearisations = 100;
  bool predicted = false;  // the points' forces are near what they will be
  // u of the points of every so manyth node from all forces, beginning with the first, which is less; of the
  // others by what changed since the last tick. 1: of all, in float64; 0: of none.
  std::size_t exact_each = 1, exact_first = 0;
  // Without friction, and where it is not empty: what all points' foreseen forces do, of the slots of points,
  // in the block's planes, m.
  std::span<const float> foreseen_moved = {};
};

// Whether SolverLimits says so of a point.
inline bool is_exact(const ContactPoint& c, std::size_t each, std::size_t first) noexcept {
  return each > 0 && static_cast<std::size_t>(c.node) % each == first % each;
}

struct SolveResult {
  bool converged = false;
  int relinearisations = 0;
  bool by_changes = false;  // moved() is what all that changed of the forces did
};

// Work space for a number of contact points, allocated once.
class ContactSolver {
 public:
  // capacity: of points; nodes: so many of them distinct; plane: of the blocks it will be given.
  ContactSolver(std::size_t capacity, std::size_t nodes, std::size_t plane);
  std::size_t capacity() const noexcept { return capacity_; }

  // gap >= 0, pressure >= 0, gap * pressure = 0 at every point, of grasped ones gap = 0; |f_t| <= mu p, and
  // where a held point slips, f_t = -mu p along the slip from its reference. Points that are not held yet
  // have no friction in this call. The order of the points and of the block's slots decides the bits.
  SolveResult solve(const ContactBlock& block, std::span<const PlacedShape> shapes,
                    std::span<ContactPoint> points, double mu, const SolverLimits& limits) noexcept;
  // The thesis (T 4.3.2): every point is moved onto the shape's surface, to where the normal at rest + u
  // leads; forces may pull. Points must be distinct nodes.
  SolveResult prescribed(const ContactBlock& block, std::span<const PlacedShape> shapes,
                         std::span<ContactPoint> points, const SolverLimits& limits) noexcept;
  // u of all loadable slots by what solve() changed of the points' forces, in the block's planes, m.
  std::span<const float> moved() const noexcept { return moved_; }

  // How far gaps may be off when a turn ends: of the tolerance, or of what they were off at first; and how
  // exactly pressures have to be solved for at least, of the tolerance.
  struct Enough {
    double off, share, solved;
  };

 private:
  static constexpr int window = 5;  // iterates Anderson's acceleration looks back on
  struct Step {
    bool solved = false;  // the complementarity problem was
    double residual = 0;  // m, largest violation of the gaps' conditions
    double turned = 0;    // N, pressure times turn of the normal, summed
    double total = 0;     // N, sum of the pressures that are not a grip's
    double largest = 0;   // N, of all
  };
  struct Column {  // differences between a proposal and the one before
    std::vector<Vec3> u, force, change;
  };
  struct History {
    int depth = 0, newest = 0;
  };
  SolveResult unilateral(const ContactBlock& block, std::span<const PlacedShape> shapes,
                         std::span<ContactPoint> points, const SolverLimits& limits) noexcept;
  Step propose(const ContactBlock& block, std::span<const PlacedShape> shapes,
               std::span<const ContactPoint> points, double tolerance) noexcept;
  bool find_pressures(std::span<const ContactPoint> points, double tolerance) noexcept;
  bool pivot(std::span<const ContactPoint> points) noexcept;
  void find_gaps(std::span<const PlacedShape> shapes, std::span<const ContactPoint> points) noexcept;
  void measure(std::span<const PlacedShape> shapes, std::span<const ContactPoint> points, Step& s) noexcept;
  void relinearise(std::span<const PlacedShape> shapes, std::span<ContactPoint> points,
                   bool measured) noexcept;
  double merit(std::span<const PlacedShape> shapes, std::span<const ContactPoint> points,
               double penalty) const noexcept;
  void accelerate(std::span<const ContactPoint> points, History& history) noexcept;
  void partial(std::span<const ContactPoint> points, double share) noexcept;
  void advance(std::span<const PlacedShape> shapes, std::span<ContactPoint> points, double penalty,
               History& history) noexcept;
  static void clear(const ContactBlock& block, std::vector<float>& planes) noexcept;
  static void add_in_planes(const ContactBlock& block, Index slot, const Vec3& v,
                            std::vector<float>& planes) noexcept;
  static void add_share(const ContactBlock& block, double share, std::span<const float> from,
                        std::vector<float>& to) noexcept;
  Vec3 reached_by(const ContactBlock& block, const ContactPoint& c, std::size_t i) const noexcept;
  Vec3 slip_of(const ContactPoint& c, const Vec3& u) const noexcept;
  void change_force(const ContactBlock& block, const ContactPoint& c, std::size_t i, const Vec3& d) noexcept;
  void add_product(const ContactBlock& block, std::span<const float> forces, std::span<float> moved) noexcept;
  void move(const ContactBlock& block) noexcept;
  bool hardly_off_normals(std::span<const ContactPoint> points) const noexcept;
  void put_on_circles(const ContactBlock& block, std::span<const ContactPoint> points, double mu,
                      bool first) noexcept;
  double press(const ContactBlock& block, std::span<const ContactPoint> points, double mu, double tolerance,
               double good_enough, double loosest) noexcept;
  double rub(const ContactBlock& block, std::span<const ContactPoint> points, double mu) noexcept;
  double begin_rub(const ContactBlock& block, std::span<const ContactPoint> points, double mu) noexcept;
  void descend(const ContactBlock& block, std::span<const ContactPoint> points, double pressures) noexcept;
  bool press_on(const ContactBlock& block, std::span<const ContactPoint> points, double mu, double tolerance,
                const Enough& enough, int most) noexcept;
  void hand_over(std::span<ContactPoint> points, double mu) noexcept;
  double rub_in_turn(const ContactBlock& block, std::span<const ContactPoint> points, double mu) noexcept;
  void calm(std::span<ContactPoint> points, bool first) noexcept;
  void displace(const ContactBlock& block, std::span<const ContactPoint> points) noexcept;
  void displace_some(const ContactBlock& block, std::span<const ContactPoint> points,
                     const SolverLimits& limits) noexcept;

  std::size_t capacity_;
  NormalCompliance normals_;
  std::vector<float> base_gradient_, gradient_, way_, product_, free_, downhill_, lower_, within_,
      change_;                          // of its rows
  std::vector<double> gap_;             // of each point at its pressure so far, linearised, times its scale
  std::vector<double> start_;           // and these pressures, N
  std::vector<double> without_;         // gaps without any pressure, times the scales
  HugeArray<double> system_;            // unilateral: capacity^2; prescribed: (3 nodes)^2
  HugeArray<double> factor_;            // capacity^2
  std::vector<double> rhs_, pressure_;  // 3 capacity, capacity
  std::vector<double> along_;           // of each slot, in planes
  std::vector<float> moved_;            // u of all slots by the change from the last tick's forces, m
  std::vector<Vec3> base_;              // u of the points under these, m
  // Of all slots, in planes: changes of forces that moved_ has not seen yet, N; a step for friction, N, and
  // what it does, m.
  std::vector<float> forces_, tried_, product_of_;
  std::vector<float> rough_work_;
  double rough_ = 0;  // m: what a product may be off
  bool pending_ = false;
  bool pulls_ = false;                        // forces that pull are left to the pressures
  bool askew_ = false;                        // what is off the normals stays
  std::vector<double> own_, weight_, curve_;  // of each point, see rub()
  std::vector<Vec3> change_of_, residual_, search_, step_of_, along_circle_;
  std::vector<std::uint8_t> slips_;  // of each point
  std::vector<Gap> reached_;         // of each point at u_
  std::vector<Path> gone_;           // and its path there
  std::vector<std::int32_t> index_;
  std::vector<std::uint8_t> active_;
  std::vector<Index> load_of_;   // of each slot, -1: no load
  std::vector<Index> loaded_;    // slots of the points, or of those with a force, each once
  std::vector<Vec3> load_;       // and these, N
  std::vector<Vec3> u_, force_;  // of the points, proposed
  std::vector<Vec3> last_u_, last_force_, last_change_;
  std::vector<Vec3> trial_;
  std::vector<double> share_;
  std::vector<Vec3> trial_force_;
  std::array<Column, window> columns_;
};

// Moves p along the outward normal of the shape at p until the distance is zero, to `tolerance` m.
Vec3 project_to_surface(const PlacedShape& shape, const Vec3& p, double tolerance) noexcept;

}  // namespace palpate
