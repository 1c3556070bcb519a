// Unilateral contact with Coulomb's friction, by turns: the pressures for given friction by block pivoting,
// the friction for given pressures by two sweeps of Gauss-Seidel with return onto the disk |f_t| <= mu p of
// each point. Panagiotopoulos, "A nonlinear programming approach to the unilateral contact- and
// friction-boundary value problem" (1975) for the turns; Jourdan, Alart, Jean, "A Gauss-Seidel like algorithm
// to solve frictional contact problems" (1998) for the sweeps; Simo, Laursen (1992) for the return.
//
// All in changes from the last tick's forces: what they do (moved_) is small, so float32 does for it, and the
// compliance along the normals only has to be near enough, as the gaps are read from moved_.
#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/contact/dense_cholesky.hpp"
#include "palpate/contact/solver.hpp"

namespace palpate {

namespace {

constexpr int sweeps = 2;
constexpr double settled = 1e-3;  // of the sum of the pressures: change of all friction in a sweep

}  // namespace

// A point's own compliance: along its normal, what its pressure does to it, and inverted along the surface.
void ContactSolver::own_compliance(const ContactBlock& block, std::size_t i, const ContactPoint& c) noexcept {
  const float* at = block.at(c.slot, c.slot);
  Mat3 own;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      own(a, b) = at[static_cast<std::size_t>(a) * block.ld() + static_cast<std::size_t>(b)];
  int least = 0;
  c.normal.cwiseAbs().minCoeff(&least);
  Eigen::Matrix<double, 3, 2> along;
  along.col(0) = c.normal.cross(Vec3::Unit(least)).normalized();
  along.col(1) = c.normal.cross(along.col(0));
  stiffness_[i] = along * (along.transpose() * own * along).inverse() * along.transpose();
}

// The gap and normal of a point where it is, and its friction along the surface there.
void ContactSolver::linearise_gap(const ContactBlock& block, std::span<const PlacedShape> shapes,
                                  ContactPoint& c, std::size_t i, bool first) noexcept {
  relinearise(shapes, c);
  if (first && c.gap < 0) active_[i] = 1;
  if (c.held) own_compliance(block, i, c);
  const Vec3 friction = force_[i] - c.normal.dot(force_[i]) * c.normal;
  if (!c.held && friction != Vec3::Zero()) add_force(block, c, i, -friction);
  rhs_[i] = c.gap / c.slope - c.normal.dot(c.u);
}

Vec3 ContactSolver::reached_by(const ContactPoint& c, std::size_t i) const noexcept {
  return base_[i] + Eigen::Map<const Vec3f>(moved_.data() + 3 * c.slot).cast<double>();
}

// The displacement of all slots goes along with a point's force.
void ContactSolver::add_force(const ContactBlock& block, const ContactPoint& c, std::size_t i,
                              const Vec3& d) noexcept {
  force_[i] += d;
  const Vec3f by = d.cast<float>();
  add_rows(block.at(c.slot, 0), 3 * block.used(), block.ld(), by.data(), moved_.data());
}

// pressure_ for the friction there is, which is cut where the pressure no longer bears it; moved_ goes along.
int ContactSolver::press(const ContactBlock& block, std::span<const ContactPoint> points,
                         double mu) noexcept {
  const std::size_t m = points.size();
  for (std::size_t i = 0; i < m; ++i) gap_[i] = rhs_[i] + points[i].normal.dot(reached_by(points[i], i));
  for (std::size_t j = 0; j < m; ++j) {
    const double p = points[j].normal.dot(force_[j]);
    const double* row = system_.data() + j * m;
    if (p != 0)
      for (std::size_t i = 0; i < m; ++i) gap_[i] -= p * row[i];
  }
  const ComplementarityWork work{
      {factor_.data(), m * m}, {along_.data(), m}, {index_.data(), m}, {factored_.data(), m}};
  const int factorisations =
      solve_complementarity(system_.data(), m, m, gap_.data(), active_, pressure_, work);
  for (std::size_t i = 0; i < m; ++i) {
    const Vec3 pressed = points[i].normal.dot(force_[i]) * points[i].normal;
    const Vec3 friction = force_[i] - pressed;
    const double size = friction.norm(), most = mu * pressure_[i];
    const Vec3 d = pressure_[i] * points[i].normal - pressed -
                   (size > most ? Vec3((1 - most / size) * friction) : Vec3(Vec3::Zero()));
    if (d != Vec3::Zero()) add_force(block, points[i], i, d);
    if (pressure_[i] <= 0) force_[i].setZero();  // but for rounding it is
  }
  return factorisations;
}

// Friction towards no slip, within mu times pressure_. The sum of what changed, N.
double ContactSolver::rub(const ContactBlock& block, std::span<const ContactPoint> points,
                          double mu) noexcept {
  double change = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ContactPoint& c = points[i];
    if (!c.held || pressure_[i] <= 0) continue;
    const Vec3 friction = force_[i] - c.normal.dot(force_[i]) * c.normal;
    const Vec3 wanted = friction - stiffness_[i] * (reached_by(c, i) - c.reference);
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
    active_[i] = points[i].force != Vec3::Zero();
    force_[i] = points[i].force, base_[i] = points[i].u;
    last_change_[i] = Vec3::Zero();
  }
  std::fill_n(moved_.begin(), 3 * block.used(), 0.0f);
  int turns = 0;
  double last_residual = std::numeric_limits<double>::infinity();
  while (turns < limits.max_relinearisations && !result.converged) {
    for (std::size_t i = 0; i < m; ++i) linearise_gap(block, shapes, points[i], i, turns == 0);
    if (last_residual > limits.tolerance * 100) {  // else the last one is near enough
      linearise(block, points);
      std::fill_n(factored_.begin(), m, std::uint8_t{2});
    }
    double total = 0, change = 0;
    int factorisations = press(block, points, mu);
    do {
      for (int k = 0; k < sweeps; ++k) change = rub(block, points, mu);
      factorisations = press(block, points, mu);
      ++turns;
      total = 0;
      for (std::size_t i = 0; i < m; ++i) total += pressure_[i];
    } while (change > settled * total && turns < limits.max_relinearisations);
    result.factorisations += factorisations;
    double residual = 0, turned = 0;
    for (std::size_t i = 0; i < m; ++i) {
      u_[i] = reached_by(points[i], i);
      const Gap g = gap_of(shapes, points[i], u_[i]);
      residual = std::max(residual, pressure_[i] > 0 ? std::abs(g.distance) : -g.distance);
      turned += pressure_[i] * (g.normal - points[i].normal).norm();
      reached_[i] = g.distance;
    }
    result.converged = factorisations > 0 && residual <= limits.tolerance && turned <= 1e-3 * total &&
                       change <= settled * total;
    if (!result.converged) calm(points, last_residual == std::numeric_limits<double>::infinity());
    last_residual = residual;
  }
  result.relinearisations = turns;
  displace(block, points);  // in float64, so no error gathers from tick to tick
  for (std::size_t i = 0; i < m; ++i) {
    points[i].pressure = pressure_[i], points[i].force = force_[i], points[i].u = u_[i];
    points[i].gap = reached_[i];
    const Vec3 friction = force_[i] - pressure_[i] * points[i].normal;
    points[i].sticks = points[i].held && friction.norm() < mu * pressure_[i] * (1 - 1e-9);
  }
  return result;
}

}  // namespace palpate
