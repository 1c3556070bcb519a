#include "palpate/contact/solver.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "palpate/contact/dense_cholesky.hpp"

namespace palpate {

namespace {
// Iterations kept downhill before the points are calmed one by one: enough for the ticks of a smooth motion.
constexpr int downhill = 2;
}  // namespace

ContactSolver::ContactSolver(std::size_t capacity, std::size_t slots)
    : capacity_(capacity),
      system_(9 * capacity * capacity),
      factor_(capacity * capacity),
      rhs_(3 * capacity),
      pressure_(capacity),
      along_(3 * slots),
      moved_(3 * slots),
      base_(capacity),
      stiffness_(capacity),
      gap_(capacity),
      factored_(capacity),
      reached_(capacity),
      index_(3 * capacity),
      active_(capacity),
      loaded_(capacity),
      load_(capacity),
      u_(capacity),
      force_(capacity),
      last_u_(capacity),
      last_force_(capacity),
      last_change_(capacity),
      trial_(capacity),
      share_(capacity),
      trial_force_(capacity) {
  for (Column& c : columns_) c.u.resize(capacity), c.force.resize(capacity), c.change.resize(capacity);
  std::fill_n(system_.data(), system_.size(), 0.0);  // touch every page now, not in the first ticks
  std::fill_n(factor_.data(), factor_.size(), 0.0);
}

// A = N^T C N, the compliance along the normals, m/N; b = gap - n.u, what the gap would be without forces.
void ContactSolver::linearise(const ContactBlock& block, std::span<const ContactPoint> points) noexcept {
  const std::size_t m = points.size(), cols = 3 * block.used();
  for (std::size_t i = 0; i < m; ++i) {
    const ContactPoint& a = points[i];
    std::fill_n(along_.begin(), cols, 0.0);
    add_rows(block.at(a.slot, 0), cols, block.ld(), a.normal.data(), along_.data());
    double* row = system_.data() + i * m;
    for (std::size_t j = i; j < m; ++j) {
      const double* c = along_.data() + 3 * points[j].slot;
      const Vec3& n = points[j].normal;
      row[j] = system_[j * m + i] = c[0] * n[0] + c[1] * n[1] + c[2] * n[2];
    }
    row[i] *= 1 + 1e-9;  // a node held from two sides would make the system singular
    rhs_[i] = a.gap / a.slope - a.normal.dot(a.u);
  }
}

// u_ of every point under the forces force_.
void ContactSolver::displace(const ContactBlock& block, std::span<const ContactPoint> points) noexcept {
  std::size_t n = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (force_[i] != Vec3::Zero()) loaded_[n] = points[i].slot, load_[n++] = force_[i];
  block.displacements({loaded_.data(), n}, {load_.data(), n}, along_);
  for (std::size_t i = 0; i < points.size(); ++i) u_[i] = Vec3::Map(along_.data() + 3 * points[i].slot);
}

// The forces for the gaps and normals at the points' u, what they do (u_, force_, pressure_), and how far
// that is from the law: the minimum of the elastic energy under the linearised gaps.
ContactSolver::Step ContactSolver::propose(const ContactBlock& block, std::span<const PlacedShape> shapes,
                                           std::span<const ContactPoint> points) noexcept {
  const std::size_t m = points.size();
  const ComplementarityWork work{{factor_.data(), m * m}, {along_.data(), m}, {index_.data(), m}};
  linearise(block, points);
  Step s;
  s.factorisations = solve_complementarity(system_.data(), m, m, rhs_.data(), active_, pressure_, work);
  for (std::size_t i = 0; i < m; ++i) force_[i] = pressure_[i] * points[i].normal;
  displace(block, points);
  for (std::size_t i = 0; i < m; ++i) {
    const Gap g = gap_of(shapes, points[i], u_[i]);
    s.residual = std::max(s.residual, pressure_[i] > 0 ? std::abs(g.distance) : -g.distance);
    s.turned += pressure_[i] * (g.normal - points[i].normal).norm();
    s.total += pressure_[i];
    s.largest = std::max(s.largest, pressure_[i]);
    reached_[i] = g.distance;
  }
  return s;
}

// Elastic energy plus what penetration costs, J, at trial_ and trial_force_: a step may only lower it.
double ContactSolver::merit(std::span<const PlacedShape> shapes, std::span<const ContactPoint> points,
                            double penalty) const noexcept {
  double energy = 0, inside = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    energy += 0.5 * trial_[i].dot(trial_force_[i]);
    const double gap = distance_of(shapes, points[i], trial_[i]);
    inside += std::max(0.0, -gap) / points[i].slope;
  }
  return energy + penalty * inside;
}

// Anderson acceleration of u <- propose(u), into trial_ and trial_force_: the combination of the last
// proposals whose changes cancel best.
void ContactSolver::accelerate(std::span<const ContactPoint> points, History& h) noexcept {
  const std::size_t m = points.size();
  h.newest = (h.newest + 1) % window;
  const auto column = [&](int k) -> Column& {
    return columns_[static_cast<std::size_t>((h.newest - k + 2 * window) % window)];
  };
  Column& now = column(0);
  for (std::size_t i = 0; i < m; ++i) {
    const Vec3 r = u_[i] - points[i].u;
    now.u[i] = u_[i] - last_u_[i];
    now.force[i] = force_[i] - last_force_[i];
    now.change[i] = r - last_change_[i];
    last_u_[i] = u_[i], last_force_[i] = force_[i], last_change_[i] = r;
  }
  Eigen::Matrix<double, window, window> a = Eigen::Matrix<double, window, window>::Identity();
  Eigen::Matrix<double, window, 1> b = Eigen::Matrix<double, window, 1>::Zero();
  for (int k = 0; k < h.depth; ++k) {
    for (int l = 0; l <= k; ++l) {
      double sum = 0;
      for (std::size_t i = 0; i < m; ++i) sum += column(k).change[i].dot(column(l).change[i]);
      a(k, l) = a(l, k) = sum;
    }
    for (std::size_t i = 0; i < m; ++i) b[k] += column(k).change[i].dot(last_change_[i]);
  }
  const double scale = h.depth > 0 ? a.diagonal().head(h.depth).maxCoeff() : 1;
  for (int k = 0; k < h.depth; ++k) a(k, k) += 1e-12 * scale + 1e-300;
  const Eigen::Matrix<double, window, 1> weight = a.ldlt().solve(b);
  for (std::size_t i = 0; i < m; ++i) {
    trial_[i] = u_[i], trial_force_[i] = force_[i];
    for (int k = 0; k < h.depth; ++k) {
      trial_[i] -= weight[k] * column(k).u[i];
      trial_force_[i] -= weight[k] * column(k).force[i];
    }
  }
  h.depth = std::min(h.depth + 1, window);
}

// The way from the points' u to the proposal, a share of it.
void ContactSolver::partial(std::span<const ContactPoint> points, double share) noexcept {
  for (std::size_t i = 0; i < points.size(); ++i) {
    trial_[i] = points[i].u + share * (u_[i] - points[i].u);
    trial_force_[i] = points[i].force + share * (force_[i] - points[i].force);
  }
}

// In a groove the force's direction turns within a fraction of what the tissue moves, and the proposals swing
// from side to side, each node on its own. Each then goes a share of its own, by Aitken's estimate from its
// last two swings. Irons, Tuck, "A version of the Aitken accelerator for computer iteration" (1969).
void ContactSolver::calm(std::span<ContactPoint> points, bool first) noexcept {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 r = u_[i] - points[i].u, d = r - last_change_[i];
    const bool swings = r.dot(last_change_[i]) < 0;
    if (first)
      share_[i] = 1;
    else if (swings)
      share_[i] = std::clamp(-share_[i] * last_change_[i].dot(d) / d.squaredNorm(), 0.02, 1.0);
    else
      share_[i] = std::min(1.0, 2 * share_[i]);
    points[i].u += share_[i] * r;
    points[i].force += share_[i] * (force_[i] - points[i].force);
    last_change_[i] = r;
  }
}

// Moves the points to where the merit is lower: the accelerated proposal, the proposal, or a share of the way
// to it.
void ContactSolver::advance(std::span<const PlacedShape> shapes, std::span<ContactPoint> points,
                            double penalty, History& h) noexcept {
  partial(points, 0);
  const double before = merit(shapes, points, penalty) * (1 + 1e-9);
  accelerate(points, h);
  if (!(merit(shapes, points, penalty) <= before)) {
    h.depth = 0;
    double share = 1;
    for (partial(points, share); share > 0.02 && !(merit(shapes, points, penalty) <= before);)
      partial(points, share *= 0.5);
  }
  for (std::size_t i = 0; i < points.size(); ++i) points[i].u = trial_[i], points[i].force = trial_force_[i];
}

SolveResult ContactSolver::unilateral(const ContactBlock& block, std::span<const PlacedShape> shapes,
                                      std::span<ContactPoint> points, const SolverLimits& limits) noexcept {
  SolveResult result;
  const std::size_t m = points.size();
  History history;
  for (std::size_t i = 0; i < m; ++i) {
    active_[i] = points[i].force != Vec3::Zero();
    last_u_[i] = last_force_[i] = last_change_[i] = Vec3::Zero();
  }
  while (result.relinearisations < limits.max_relinearisations && !result.converged) {
    for (std::size_t i = 0; i < m; ++i) {
      ContactPoint& c = points[i];
      relinearise(shapes, c);
      if (result.relinearisations == 0 && c.gap < 0) active_[i] = 1;
    }
    ++result.relinearisations;
    const Step s = propose(block, shapes, points);
    result.factorisations += s.factorisations;
    result.converged = s.factorisations > 0 && s.residual <= limits.tolerance && s.turned <= 1e-3 * s.total;
    if (!result.converged && result.relinearisations < limits.max_relinearisations)
      result.relinearisations <= downhill ? advance(shapes, points, 1.5 * s.largest, history)
                                          : calm(points, result.relinearisations == downhill + 1);
  }
  for (std::size_t i = 0; i < m; ++i) {
    points[i].pressure = pressure_[i], points[i].force = force_[i], points[i].u = u_[i];
    points[i].gap = reached_[i];
  }
  return result;
}

Vec3 project_to_surface(const PlacedShape& shape, const Vec3& p, double tolerance) noexcept {
  const Gap start = shape.gap(p);
  if (std::abs(start.distance) <= tolerance) return p;
  // Along the normal n the distance f(t) at p + t n grows with a slope near 1; bracket its zero, then
  // Illinois regula falsi.
  const auto f = [&](double t) { return shape.distance(p + t * start.normal); };
  double a = 0, fa = start.distance, b = -start.distance, fb = f(b);
  for (int k = 0; k < 60 && fa * fb > 0; ++k) a = b, fa = fb, b -= 1.5 * fb, fb = f(b);
  if (!(fa * fb <= 0)) return p - start.distance * start.normal;
  for (int k = 0; k < 100 && std::abs(fb) > 0.1 * tolerance; ++k) {
    const double c = b - fb * (b - a) / (fb - fa), fc = f(c);
    if (fc * fb <= 0)
      a = b, fa = fb;
    else
      fa *= 0.5;
    b = c, fb = fc;
  }
  return p + b * start.normal;
}

SolveResult ContactSolver::prescribed(const ContactBlock& block, std::span<const PlacedShape> shapes,
                                      std::span<ContactPoint> points, const SolverLimits& limits) noexcept {
  SolveResult result;
  const std::size_t m = points.size(), n = 3 * m;
  for (std::size_t i = 0; i < m; ++i) {
    ContactPoint& c = points[i];
    const PlacedShape& shape = shapes[static_cast<std::size_t>(c.instrument)];
    c.normal = shape.gap(c.rest + c.u).normal;
    c.u = project_to_surface(shape, c.rest + c.u, limits.tolerance) - c.rest;
    c.gap = shape.distance(c.rest + c.u);
    for (std::size_t a = 0; a < 3; ++a) rhs_[3 * i + a] = c.u[static_cast<int>(a)];
    for (std::size_t j = i; j < m; ++j)
      for (std::size_t a = 0; a < 3; ++a) {
        const float* from = block.at(c.slot, points[j].slot) + a * block.ld();
        std::copy_n(from, 3, system_.data() + (3 * i + a) * n + 3 * j);
      }
  }
  ++result.relinearisations;
  ++result.factorisations;
  if (!cholesky(system_.data(), n, n)) return result;
  cholesky_solve(system_.data(), n, n, rhs_.data());
  result.converged = true;
  for (std::size_t i = 0; i < m; ++i) {
    points[i].force = Vec3(rhs_[3 * i], rhs_[3 * i + 1], rhs_[3 * i + 2]);
    points[i].pressure = points[i].force.dot(points[i].normal);
    if (std::abs(points[i].gap) > limits.tolerance) result.converged = false;
  }
  return result;
}

}  // namespace palpate
