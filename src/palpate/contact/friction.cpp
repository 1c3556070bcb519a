// Unilateral contact with Coulomb's friction, by turns: the pressures for given friction by projected
// gradients, the friction for given pressures by two sweeps of Gauss-Seidel with return onto the disk |f_t|
// <= mu p of each point. Panagiotopoulos, "A nonlinear programming approach to the unilateral contact- and
// friction-boundary value problem" (1975) for the turns; Jourdan, Alart, Jean, "A Gauss-Seidel like algorithm
// to solve frictional contact problems" (1998) for the sweeps; Simo, Laursen (1992) for the return.
//
// All in changes from the last tick's forces: what they do (moved_) is small, so float32 does for it, and the
// compliance along the normals only has to be near enough, as the gaps are read from moved_.
#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/contact/solver.hpp"

namespace palpate {

namespace {

constexpr int sweeps = 2;
constexpr double linear_share = 0.1;  // of the tolerance: how exactly pressures are solved for
constexpr double loose = 0.01;        // and of what the gaps are off before
constexpr double settled = 1e-3;      // of the sum of the pressures: change of all friction in a sweep

}  // namespace

// A point's own compliance, inverted along the surface.
void ContactSolver::own_compliance(const ContactBlock& block, std::size_t i, const ContactPoint& c) noexcept {
  const Mat3 own = block.between(c.slot, c.slot);
  int least = 0;
  c.normal.cwiseAbs().minCoeff(&least);
  Eigen::Matrix<double, 3, 2> along;
  along.col(0) = c.normal.cross(Vec3::Unit(least)).normalized();
  along.col(1) = c.normal.cross(along.col(0));
  stiffness_[i] = along * (along.transpose() * own * along).inverse() * along.transpose();
}

// The friction of a point that has a gap and normal, along the surface there.
void ContactSolver::linearise_friction(const ContactBlock& block, const ContactPoint& c,
                                       std::size_t i) noexcept {
  if (c.held) own_compliance(block, i, c);
  const Vec3 friction = force_[i] - c.normal.dot(force_[i]) * c.normal;
  if (!c.held && friction != Vec3::Zero()) add_force(block, c, i, -friction);
  rhs_[i] = c.gap / c.slope - c.normal.dot(c.u);
}

Vec3 ContactSolver::reached_by(const ContactBlock& block, const ContactPoint& c,
                               std::size_t i) const noexcept {
  return base_[i] + block.in_planes<float>(moved_, c.slot);
}

// The displacement of all slots goes along with a point's force.
void ContactSolver::add_force(const ContactBlock& block, const ContactPoint& c, std::size_t i,
                              const Vec3& d) noexcept {
  force_[i] += d;
  block.add_displacements(c.slot, d, moved_);
}

// pressure_ for the friction there is, which is cut where the pressure no longer bears it; moved_ goes along.
bool ContactSolver::press(const ContactBlock& block, std::span<const ContactPoint> points, double mu,
                          double tolerance) noexcept {
  const std::size_t m = points.size();
  double off = 0;
  for (std::size_t i = 0; i < m; ++i) {
    const double gap = rhs_[i] + points[i].normal.dot(reached_by(block, points[i], i));
    gap_[i] = scale_[i] * gap;
    start_[i] = start_of(points[i], force_[i]);
    off = std::max(off, points[i].grasped || start_[i] > 0 ? std::abs(gap) : -gap);
  }
  const bool solved = find_pressures(points, std::max(tolerance, loose * off));
  for (std::size_t i = 0; i < m; ++i) {
    const Vec3 pressed = points[i].normal.dot(force_[i]) * points[i].normal;
    const Vec3 friction = force_[i] - pressed;
    const double size = friction.norm(), most = std::max(0.0, mu * pressure_[i]);
    const Vec3 d = pressure_[i] * points[i].normal - pressed -
                   (size > most ? Vec3((1 - most / size) * friction) : Vec3(Vec3::Zero()));
    if (d != Vec3::Zero()) add_force(block, points[i], i, d);
    if (pressure_[i] <= 0 && !points[i].grasped) force_[i].setZero();  // but for rounding it is
  }
  return solved;
}

// Friction towards no slip, within mu times pressure_. The sum of what changed, N.
double ContactSolver::rub(const ContactBlock& block, std::span<const ContactPoint> points,
                          double mu) noexcept {
  double change = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ContactPoint& c = points[i];
    if (!c.held || pressure_[i] <= 0) continue;
    const Vec3 friction = force_[i] - c.normal.dot(force_[i]) * c.normal;
    const Vec3 wanted = friction - stiffness_[i] * (reached_by(block, c, i) - c.reference);
    const double size = wanted.norm(), most = mu * pressure_[i];
    const Vec3 d = (size > most ? Vec3(most / size * wanted) : wanted) - friction;
    if (d == Vec3::Zero()) continue;
    add_force(block, c, i, d);
    change += d.norm();
  }
  return change;
}

SolveResult ContactSolver::coulomb(const ContactBlock& block, std::span<const PlacedShape> shapes,
                                   std::span<ContactPoint> points, double mu,
                                   const SolverLimits& limits) noexcept {
  SolveResult result;
  const std::size_t m = points.size();
  for (std::size_t i = 0; i < m; ++i) {
    force_[i] = points[i].force, base_[i] = points[i].u;
    last_change_[i] = Vec3::Zero();
  }
  std::fill(moved_.begin(), moved_.end(), 0.0f);
  int turns = 0;
  double last_residual = std::numeric_limits<double>::infinity();
  while (turns < limits.max_relinearisations && !result.converged) {
    relinearise(shapes, points, turns > 0);
    for (std::size_t i = 0; i < m; ++i) linearise_friction(block, points[i], i);
    if (last_residual > limits.tolerance * 100) linearise(block, points);  // else the last one will do
    if (turns++ == 0) press(block, points, mu, linear_share * limits.tolerance);
    double change = 0;
    for (int k = 0; k < sweeps; ++k) change = rub(block, points, mu);
    const bool solved = press(block, points, mu, linear_share * limits.tolerance);
    for (std::size_t i = 0; i < m; ++i) u_[i] = reached_by(block, points[i], i);
    Step s;
    measure(shapes, points, s);
    result.converged =
        solved && s.residual <= limits.tolerance && s.turned <= 1e-3 * s.total && change <= settled * s.total;
    if (!result.converged) calm(points, last_residual == std::numeric_limits<double>::infinity());
    last_residual = s.residual;
  }
  result.relinearisations = turns;
  displace(block, points);  // in float64, so no error gathers from tick to tick
  for (std::size_t i = 0; i < m; ++i) {
    points[i].pressure = pressure_[i], points[i].force = force_[i], points[i].u = u_[i];
    points[i].gap = reached_[i].distance, points[i].path = gone_[i];
    const Vec3 friction = force_[i] - pressure_[i] * points[i].normal;
    points[i].sticks = points[i].held && friction.norm() < mu * pressure_[i] * (1 - 1e-9);
  }
  return result;
}

}  // namespace palpate
