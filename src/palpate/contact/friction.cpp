// Unilateral contact with Coulomb's friction, by turns: the pressures for given friction by block pivoting,
// the friction for given pressures by Gauss-Seidel with return onto the disk |f_t| <= mu p of each point.
// Panagiotopoulos, "A nonlinear programming approach to the unilateral contact- and friction-boundary value
// problem" (1975) for the turns; Jourdan, Alart, Jean, "A Gauss-Seidel like algorithm to solve frictional
// contact problems" (1998) for the sweeps; Simo, Laursen (1992) for the return.
#include <algorithm>
#include <cmath>

#include "palpate/contact/dense_cholesky.hpp"
#include "palpate/contact/solver.hpp"

namespace palpate {

namespace {

constexpr int most_turns = 30, most_sweeps = 4;
constexpr double settled = 1e-4;  // of the sum of the pressures: change of all friction in a turn

// The inverse of a point's own compliance along the surface, N/m.
Mat3 tangential_stiffness(const ContactBlock& block, const ContactPoint& c) noexcept {
  int least = 0;
  c.normal.cwiseAbs().minCoeff(&least);
  Eigen::Matrix<double, 3, 2> along;
  along.col(0) = c.normal.cross(Vec3::Unit(least)).normalized();
  along.col(1) = c.normal.cross(along.col(0));
  const float* at = block.at(c.slot, c.slot);
  Mat3 own;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      own(i, j) = at[static_cast<std::size_t>(i) * block.ld() + static_cast<std::size_t>(j)];
  return along * (along.transpose() * own * along).inverse() * along.transpose();
}

}  // namespace

// friction_ towards no slip, within mu times pressure_; moved_ (of all slots) goes along. The sum of what
// changed, N.
double ContactSolver::sweep_friction(const ContactBlock& block, std::span<const ContactPoint> points,
                                     double mu, double enough) noexcept {
  const std::size_t m = points.size(), cols = 3 * block.used();
  double first = 0;
  for (int sweep = 0; sweep < most_sweeps; ++sweep) {
    double change = 0;
    for (std::size_t i = 0; i < m; ++i) {
      const ContactPoint& c = points[i];
      if (!c.held || pressure_[i] <= 0) continue;
      const Vec3 slip = Vec3::Map(moved_.data() + 3 * c.slot) - c.reference;
      const Vec3 wanted = friction_[i] - stiffness_[i] * slip;
      const double most = mu * pressure_[i], size = wanted.norm();
      const Vec3 d = (size > most ? Vec3(most / size * wanted) : wanted) - friction_[i];
      if (d == Vec3::Zero()) continue;
      friction_[i] += d;
      add_rows(block.at(c.slot, 0), cols, block.ld(), d.data(), moved_.data());
      change += d.norm();
    }
    if (sweep == 0) first = change;
    if (change <= 0.1 * enough) break;
  }
  return first;
}

SolveResult ContactSolver::coulomb(const ContactBlock& block, std::span<const PlacedShape> shapes,
                                   std::span<ContactPoint> points, double mu,
                                   const SolverLimits& limits) noexcept {
  SolveResult result;
  const std::size_t m = points.size();
  for (std::size_t i = 0; i < m; ++i) {
    active_[i] = points[i].force != Vec3::Zero();
    friction_[i] = points[i].held ? points[i].force : Vec3(Vec3::Zero());
    last_change_[i] = Vec3::Zero();
  }
  bool first = true;
  while (result.relinearisations < limits.max_relinearisations && !result.converged) {
    for (std::size_t i = 0; i < m; ++i) {
      ContactPoint& c = points[i];
      const Gap g = gap_of(shapes, c, c.u);
      c.gap = g.distance, c.normal = g.normal, c.slope = g.slope;
      if (result.relinearisations == 0 && c.gap < 0) active_[i] = 1;
      friction_[i] -= c.normal.dot(friction_[i]) * c.normal;
    }
    linearise(block, points);
    for (std::size_t i = 0; i < m; ++i)
      if (points[i].held) stiffness_[i] = tangential_stiffness(block, points[i]);
    std::fill_n(factored_.begin(), m, std::uint8_t{2});
    double total = 0, change = 0;
    int factorisations = 0;
    for (int turn = 0; turn < most_turns && result.relinearisations < limits.max_relinearisations; ++turn) {
      ++result.relinearisations;
      std::copy_n(friction_.begin(), m, force_.begin());
      displace(block, points);
      for (std::size_t i = 0; i < m; ++i) gap_[i] = rhs_[i] + points[i].normal.dot(u_[i]);
      const ComplementarityWork work{
          {factor_.data(), m * m}, {along_.data(), m}, {index_.data(), m}, {factored_.data(), m}};
      factorisations = solve_complementarity(system_.data(), m, m, gap_.data(), active_, pressure_, work);
      result.factorisations += factorisations;
      total = 0;
      for (std::size_t i = 0; i < m; ++i) {
        if (pressure_[i] <= 0) friction_[i].setZero();
        force_[i] = pressure_[i] * points[i].normal + friction_[i];
        total += pressure_[i];
      }
      displace(block, points);
      std::copy_n(along_.begin(), 3 * block.used(), moved_.begin());
      change = sweep_friction(block, points, mu, settled * total);
      if (change <= settled * total) break;
    }
    for (std::size_t i = 0; i < m; ++i) force_[i] = pressure_[i] * points[i].normal + friction_[i];
    displace(block, points);
    double residual = 0, turned = 0;
    for (std::size_t i = 0; i < m; ++i) {
      const Gap g = gap_of(shapes, points[i], u_[i]);
      residual = std::max(residual, pressure_[i] > 0 ? std::abs(g.distance) : -g.distance);
      turned += pressure_[i] * (g.normal - points[i].normal).norm();
      reached_[i] = g.distance;
    }
    result.converged = factorisations > 0 && residual <= limits.tolerance && turned <= 1e-3 * total &&
                       change <= 1e-3 * total;
    if (!result.converged) calm(points, first);
    first = false;
  }
  for (std::size_t i = 0; i < m; ++i) {
    points[i].pressure = pressure_[i], points[i].force = force_[i], points[i].u = u_[i];
    points[i].gap = reached_[i];
    points[i].sticks = points[i].held && friction_[i].norm() < mu * pressure_[i] * (1 - 1e-9);
  }
  return result;
}

}  // namespace palpate
