// Unilateral contact with Coulomb's friction, by turns: friction for given pressures, pressures for given
// friction. Panagiotopoulos, "A nonlinear programming approach to the unilateral contact- and
// friction-boundary value problem" (1975). Friction is the least work over the disks |f_t| <= mu p: a step of
// Newton's method, in which what slips turns along its circle and what sticks goes anywhere along the surface
// (Alart, Curnier, "A mixed formulation for frictional contact problems prone to Newton like solution
// methods", 1991), by conjugate gradients on half of C. While a motion goes on as it went, the forces
// foreseen are so near that one turn does. Where these steps go to and fro between sticking and slipping,
// sweeps of Gauss-Seidel take over (Jourdan, Alart, Jean, "A Gauss-Seidel like algorithm to solve frictional
// contact problems", 1998).
//
// All in changes from the last tick's forces: what they do (moved_) is small, so float32 does for it, and the
// compliance along the normals only has to be near enough, as the gaps are read from moved_.
#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/contact/solver.hpp"

namespace palpate {

namespace {

constexpr int newton_turns = 4, sweeps = 2, most_presses = 3;  // turns; of the others, and of a turn
// Of a normal, rad, so that its row of N^T C N may stay: in motion, which forgives a change of the forces
// that is off by as much; and where they have to come to rest.
constexpr double little_turned = 0.015, hardly_turned = 1e-4;
constexpr double any = std::numeric_limits<double>::infinity();
// Where all is as foreseen the first turn does it. Else the next one does what is a twentieth.
constexpr ContactSolver::Enough as_foreseen{0.9, 0, 0.5}, in_motion{0.3, 0.05, any}, at_rest{0.02, 0.05, any};
constexpr int most_products = 12;     // of a step for friction
constexpr double reduced = 0.3;       // of its residual, by which it is reduced
constexpr double stiffest = 1e-4;     // way of a step, of what each point alone would give: less is rounding
constexpr double longest_rough = 2;   // step of which a rough product tells what it moves
constexpr double negligible = 2e-4;   // of the sum of the pressures: friction that is as much off is right
constexpr double rough_share = 0.02;  // of the tolerance: what a product may be off
// Of the sum of the pressures, without friction: what foreseen forces may be off their normals for a tick,
// which spares a product. It is a tenth of what their turning may leave.
constexpr double hardly_askew = 1e-4;
constexpr double linear_share = 0.1;  // of the tolerance: how exactly pressures are solved for
constexpr double loose = 0.01;        // and of what the gaps are off before
constexpr double settled = 1e-3;      // of the sum of the pressures: change of all friction in a sweep

}  // namespace

void ContactSolver::clear(const ContactBlock& block, std::vector<float>& planes) noexcept {
  for (std::size_t b = 0; b < 3; ++b) std::fill_n(planes.data() + b * block.plane(), block.width(), 0.0f);
}

void ContactSolver::add_in_planes(const ContactBlock& block, Index slot, const Vec3& v,
                                  std::vector<float>& planes) noexcept {
  for (std::size_t b = 0; b < 3; ++b)
    planes[b * block.plane() + static_cast<std::size_t>(slot)] += static_cast<float>(v[static_cast<int>(b)]);
}

Vec3 ContactSolver::reached_by(const ContactBlock& block, const ContactPoint& c,
                               std::size_t i) const noexcept {
  return base_[i] + block.in_planes<float>(moved_, c.slot);
}

void ContactSolver::add_share(const ContactBlock& block, double share, std::span<const float> from,
                              std::vector<float>& to) noexcept {
  for (std::size_t b = 0; b < 3; ++b)
    for (std::size_t k = b * block.plane(); k < b * block.plane() + block.width(); ++k)
      to[k] += static_cast<float>(share) * from[k];
}

// Along the surface.
Vec3 ContactSolver::slip_of(const ContactPoint& c, const Vec3& u) const noexcept {
  const Vec3 slip = u - c.reference;
  return slip - c.normal.dot(slip) * c.normal;
}

void ContactSolver::change_force(const ContactBlock& block, const ContactPoint& c, std::size_t i,
                                 const Vec3& d) noexcept {
  if (d == Vec3::Zero()) return;
  force_[i] += d;
  add_in_planes(block, c.slot, d, forces_);
  pending_ = true;
}

// Corrections are so small that half the bytes of C are enough for them.
void ContactSolver::add_product(const ContactBlock& block, std::span<const float> forces,
                                std::span<float> moved) noexcept {
  if (!block.add_rough_product(forces, static_cast<float>(rough_), moved, rough_work_))
    block.add_product(forces, moved);
}

// What changed of the forces moves all slots.
void ContactSolver::move(const ContactBlock& block) noexcept {
  if (!pending_) return;
  add_product(block, forces_, moved_);
  clear(block, forces_);
  pending_ = false;
}

// pressure_ by the linearised gaps at the forces so far, and friction that follows it: what slips keeps its
// direction and takes its share. Returns how far the gaps were off, m; negative where they were not solved.
double ContactSolver::press(const ContactBlock& block, std::span<const ContactPoint> points, double mu,
                            double tolerance, double good_enough, double loosest) noexcept {
  const std::size_t m = points.size();
  double off = 0;
  for (std::size_t i = 0; i < m; ++i) {
    start_[i] = points[i].normal.dot(force_[i]);
    const double gap = rhs_[i] + points[i].normal.dot(reached_by(block, points[i], i));
    gap_[i] = normals_.scale(i) * gap;
    const bool bears = points[i].grasped || start_[i] > 0 || (pulls_ && start_[i] < 0);
    off = std::max(off, bears ? std::abs(gap) : -gap);
  }
  if (off <= good_enough) {
    for (std::size_t i = 0; i < m; ++i) pressure_[i] = start_of(points[i], force_[i]);
    return off;
  }
  const bool solved = find_pressures(points, std::max(tolerance, std::min(loose * off, loosest)));
  for (std::size_t i = 0; i < m; ++i) {
    const ContactPoint& c = points[i];
    Vec3 friction = force_[i] - start_[i] * c.normal;
    const double size = friction.norm(), most = askew_ ? size : std::max(0.0, mu * pressure_[i]);
    if (size > most || (slips_[i] && size > 0)) friction *= most / size;
    const bool pressed = pressure_[i] > 0 || c.grasped;
    change_force(block, c, i,
                 pressed ? Vec3(pressure_[i] * c.normal + friction - force_[i]) : Vec3(-force_[i]));
    if (!pressed) force_[i].setZero();  // but for rounding it is
  }
  move(block);
  return solved ? off : -1;
}

// Prepares a step for friction at the pressures there are. The sum of these, N.
double ContactSolver::begin_rub(const ContactBlock& block, std::span<const ContactPoint> points,
                                double mu) noexcept {
  double pressures = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ContactPoint& c = points[i];
    change_of_[i] = search_[i] = residual_[i] = Vec3::Zero();
    weight_[i] = curve_[i] = 0;
    const double p = c.normal.dot(force_[i]);
    if (p <= 0 || c.grasped) continue;
    pressures += p;
    if (!c.held) continue;
    const Vec3 friction = force_[i] - p * c.normal;
    Vec3 slip = slip_of(c, reached_by(block, c, i));
    slips_[i] = friction != Vec3::Zero() && (friction - slip / own_[i]).norm() > mu * p;
    if (slips_[i]) {
      along_circle_[i] = c.normal.cross(friction).normalized();
      curve_[i] = std::max(0.0, -slip.dot(friction) / friction.squaredNorm());
      slip = along_circle_[i].dot(slip) * along_circle_[i];
    }
    weight_[i] = 1 / (own_[i] + curve_[i]);
    residual_[i] = -slip;
  }
  return pressures;
}

// The step: conjugate gradients for change_of_, with the points' own compliance for preconditioner; moved_
// goes along.
void ContactSolver::descend(const ContactBlock& block, std::span<const ContactPoint> points,
                            double pressures) noexcept {
  const std::size_t m = points.size();
  double size = 0, off = 0;  // of the residual; and of the friction, about, N
  for (std::size_t i = 0; i < m; ++i) {
    search_[i] = weight_[i] * residual_[i];
    size += residual_[i].dot(search_[i]), off += search_[i].norm();
  }
  const double small = reduced * reduced * size;
  for (int k = 0; k < most_products && size > small && (k == 0 || off > negligible * pressures); ++k) {
    clear(block, tried_), clear(block, product_of_);
    for (std::size_t i = 0; i < m; ++i)
      if (weight_[i] > 0) add_in_planes(block, points[i].slot, search_[i], tried_);
    add_product(block, tried_, product_of_);
    double bent = 0, alone = 0;  // alone: were every point's compliance its own
    for (std::size_t i = 0; i < m; ++i) {
      if (weight_[i] == 0) continue;
      Vec3& moved = step_of_[i] = block.in_planes<float>(product_of_, points[i].slot);
      moved = slips_[i] ? Vec3(along_circle_[i].dot(moved) * along_circle_[i] + curve_[i] * search_[i])
                        : Vec3(moved - points[i].normal.dot(moved) * points[i].normal);
      bent += search_[i].dot(moved);
      alone += search_[i].squaredNorm() / weight_[i];
    }
    // Two instruments may pull a node both ways, which costs no work: along that way there is no end.
    if (!(bent > stiffest * alone)) return;
    const double length = size / bent, before = size;
    if (length > longest_rough) clear(block, product_of_), block.add_product(tried_, product_of_);
    add_share(block, length, product_of_, moved_);
    size = off = 0;
    for (std::size_t i = 0; i < m; ++i) {
      if (weight_[i] == 0) continue;
      change_of_[i] += length * search_[i];
      residual_[i] -= length * step_of_[i];
      size += weight_[i] * residual_[i].squaredNorm(), off += weight_[i] * residual_[i].norm();
    }
    for (std::size_t i = 0; i < m; ++i) search_[i] = weight_[i] * residual_[i] + size / before * search_[i];
  }
}

// Friction for the pressures there are. The sum of what changed, N.
double ContactSolver::rub(const ContactBlock& block, std::span<const ContactPoint> points,
                          double mu) noexcept {
  descend(block, points, begin_rub(block, points, mu));
  double change = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ContactPoint& c = points[i];
    if (c.grasped) continue;
    const double p = c.normal.dot(force_[i]), radius = std::max(0.0, mu * p);
    const Vec3 friction = force_[i] - p * c.normal;
    Vec3 wanted = friction + change_of_[i];
    const double size = wanted.norm();
    if (size > radius || (slips_[i] && size > 0)) wanted *= radius / size;
    change += (wanted - friction).norm();
    // What the step has moved is known; what the way back onto the circles does, waits.
    force_[i] += change_of_[i];
    change_force(block, c, i, wanted - friction - change_of_[i]);
  }
  return change;
}

// The same point by point, each for what the others do by then: slow and sure, for where Newton's steps go to
// and fro between sticking and slipping.
double ContactSolver::rub_in_turn(const ContactBlock& block, std::span<const ContactPoint> points,
                                  double mu) noexcept {
  double change = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ContactPoint& c = points[i];
    const double p = c.normal.dot(force_[i]), radius = mu * p;
    if (!c.held || p <= 0 || c.grasped) continue;
    const Vec3 friction = force_[i] - p * c.normal;
    Vec3 wanted = friction - slip_of(c, reached_by(block, c, i)) / (1.5 * own_[i]);
    const double size = wanted.norm();
    slips_[i] = 0;  // friction is only cut then, where pressures no longer bear it
    if (size > radius) wanted *= radius / size;
    const Vec3 d = wanted - friction;
    force_[i] += d;
    block.add_displacements(c.slot, d, moved_);
    change += d.norm();
  }
  return change;
}

// Whether forces without friction are so near their normals that they may stay as they are.
bool ContactSolver::hardly_off_normals(std::span<const ContactPoint> points) const noexcept {
  double askew = 0, all = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double p = points[i].normal.dot(force_[i]);
    askew += (force_[i] - p * points[i].normal).norm(), all += std::abs(p);
  }
  return askew <= hardly_askew * all;
}

// Before a turn: no pull, no friction where there can be none, and what slips on its circle. first: the
// foreseen forces have not moved the points yet.
void ContactSolver::put_on_circles(const ContactBlock& block, std::span<const ContactPoint> points, double mu,
                                   bool first) noexcept {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ContactPoint& c = points[i];
    const double p = c.normal.dot(force_[i]), radius = mu * p;
    if (c.grasped) continue;
    if (p <= 0 && !pulls_) {
      change_force(block, c, i, -force_[i]);
      continue;
    }
    const Vec3 friction = force_[i] - p * c.normal;
    if (mu < 0) continue;
    if (!c.held || mu == 0) {
      change_force(block, c, i, -friction);
      continue;
    }
    const Vec3 trial = friction - slip_of(c, first ? c.u : reached_by(block, c, i)) / own_[i];
    slips_[i] = trial.norm() > radius;
    if (!slips_[i]) continue;
    const Vec3& to = friction.norm() > 0.5 * radius ? friction : trial;
    change_force(block, c, i, radius / to.norm() * to - friction);
  }
}

// Pressures until the gaps hardly change: friction that follows them moves the gaps again, by a tenth, and
// rows of N^T C N that stayed solve them not quite. False: not solved.
bool ContactSolver::press_on(const ContactBlock& block, std::span<const ContactPoint> points, double mu,
                             double tolerance, const Enough& enough, int most) noexcept {
  double first = 0;
  for (int k = 0; k < most; ++k) {
    const double good_enough = k == 0 ? 0 : std::max(enough.share * first, enough.off * tolerance);
    const double off =
        press(block, points, mu, linear_share * tolerance, good_enough, enough.solved * tolerance);
    if (off < 0) return false;
    if (off <= good_enough) break;
    if (k == 0) first = off;
  }
  return true;
}

// Forces, paths and displacements go to the points.
void ContactSolver::hand_over(std::span<ContactPoint> points, double mu) noexcept {
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].pressure = pressure_[i], points[i].force = force_[i], points[i].u = u_[i];
    points[i].gap = reached_[i].distance, points[i].path = gone_[i];
    const Vec3 friction = force_[i] - pressure_[i] * points[i].normal;
    points[i].sticks = points[i].held && friction.norm() < mu * pressure_[i] * (1 - 1e-9);
  }
}

SolveResult ContactSolver::solve(const ContactBlock& block, std::span<const PlacedShape> shapes,
                                 std::span<ContactPoint> points, double mu,
                                 const SolverLimits& limits) noexcept {
  SolveResult result;
  const std::size_t m = points.size();
  clear(block, moved_), clear(block, forces_), pending_ = false;
  rough_ = rough_share * limits.tolerance;
  const bool moved = mu == 0 && !limits.foreseen_moved.empty();  // already, by what is foreseen
  if (moved) add_share(block, 1, limits.foreseen_moved, moved_);
  for (std::size_t i = 0; i < m; ++i) {
    force_[i] = points[i].force, base_[i] = points[i].u, last_change_[i] = Vec3::Zero();
    if (mu > 0) own_[i] = block.own(points[i].slot).trace() / 3;
    if (moved)
      force_[i] += points[i].foreseen;
    else
      change_force(block, points[i], i, points[i].foreseen);
    points[i].u += points[i].foreseen_u;
  }
  const int most = mu > 0 ? limits.max_relinearisations : std::min(newton_turns, limits.max_relinearisations);
  while (result.relinearisations < most && !result.converged) {
    const int turn = ++result.relinearisations;
    const bool by_newton = turn <= newton_turns;
    relinearise(shapes, points, turn > 1);
    for (std::size_t i = 0; i < m; ++i) {
      rhs_[i] = points[i].gap / points[i].slope - points[i].normal.dot(points[i].u);
      slips_[i] = 0;
    }
    normals_.update(block, points, turn == 1 && limits.predicted ? little_turned : hardly_turned);
    pulls_ = moved && turn == 1;
    askew_ = pulls_ && hardly_off_normals(points);
    if (!askew_) put_on_circles(block, points, by_newton ? mu : -1, turn == 1);
    double change = 0;
    if (mu == 0 || !by_newton || turn == 1) move(block);
    if (mu > 0 && turn == 1 && !limits.predicted)
      press(block, points, mu, linear_share * limits.tolerance, 0, any);
    if (mu > 0 && by_newton)
      change = rub(block, points, mu);
    else if (mu > 0)
      for (int k = 0; k < sweeps; ++k) change = rub_in_turn(block, points, mu);
    const Enough& enough = moved ? as_foreseen : limits.predicted ? in_motion : at_rest;
    const bool solved = press_on(block, points, mu, limits.tolerance, enough, by_newton ? most_presses : 1);
    move(block);
    for (std::size_t i = 0; i < m; ++i) u_[i] = reached_by(block, points[i], i);
    Step s;
    measure(shapes, points, s);
    result.converged =
        solved && s.residual <= limits.tolerance && s.turned <= 1e-3 * s.total && change <= settled * s.total;
    if (!result.converged) calm(points, turn == 1);
  }
  if (limits.exact_each == 1) displace(block, points);
  if (limits.exact_each > 1) displace_some(block, points, limits);
  hand_over(points, mu);
  result.by_changes = true;
  SolverLimits rest = limits;
  rest.max_relinearisations -= result.relinearisations;
  if (mu > 0 || result.converged || rest.max_relinearisations <= 0) return result;
  const SolveResult more = unilateral(block, shapes, points, rest);
  return {more.converged, result.relinearisations + more.relinearisations};
}

}  // namespace palpate
