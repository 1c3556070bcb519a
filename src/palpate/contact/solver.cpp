#include "palpate/contact/solver.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "palpate/base/clones.hpp"
#include "palpate/contact/dense_cholesky.hpp"
#include "palpate/contact/projected_gradients.hpp"

namespace palpate {

namespace {
// Iterations kept downhill before the points are calmed one by one: enough for the ticks of a smooth motion.
constexpr int downhill = 2;
// Of the tolerance of the gaps: how exactly a linearised problem is solved.
constexpr double linear_share = 0.1;
// And of all forces: a gap's error times the node's own stiffness, which in stone is the larger of the two.
constexpr double force_share = 1e-5;
}  // namespace

ContactSolver::ContactSolver(std::size_t capacity, std::size_t nodes, std::size_t plane)
    : capacity_(capacity),
      normals_(plane, capacity),
      base_gradient_(NormalCompliance::most(plane, capacity)),
      gradient_(base_gradient_.size()),
      way_(base_gradient_.size()),
      product_(base_gradient_.size()),
      free_(base_gradient_.size()),
      downhill_(base_gradient_.size()),
      lower_(base_gradient_.size()),
      within_(base_gradient_.size()),
      change_(base_gradient_.size()),
      gap_(capacity),
      start_(capacity),
      without_(capacity),
      system_(std::max(capacity * capacity, 9 * nodes * nodes)),
      factor_(capacity * capacity),
      rhs_(3 * capacity),
      pressure_(capacity),
      along_(std::max(capacity, 3 * plane)),
      moved_(3 * plane),
      base_(capacity),
      forces_(3 * plane),
      tried_(3 * plane),
      product_of_(3 * plane),
      rough_work_(6 * plane),
      own_(capacity),
      weight_(capacity),
      curve_(capacity),
      change_of_(capacity),
      residual_(capacity),
      search_(capacity),
      step_of_(capacity),
      along_circle_(capacity),
      slips_(capacity),
      reached_(capacity),
      gone_(capacity),
      index_(3 * capacity),
      active_(capacity),
      load_of_(plane, -1),
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

// pressure_ for gap_ at the pressures start_, to `tolerance` m of the linearised gaps. False: not found.
bool ContactSolver::find_pressures(std::span<const ContactPoint> points, double tolerance) noexcept {
  const std::size_t m = points.size();
  double total = 0;
  for (std::size_t i = 0; i < m; ++i) total += std::abs(start_[i]);
  const double never_more = total > 0 ? force_share * total : std::numeric_limits<double>::infinity();
  const std::size_t n = normals_.size(), end = (n + 15) / 16 * 16;
  std::fill_n(base_gradient_.begin(), end, 1e30f);  // where no point is nothing presses
  std::fill_n(lower_.begin(), end, 0.0f), std::fill_n(within_.begin(), end, 0.0f);
  std::fill_n(change_.begin(), end, 0.0f);
  for (std::size_t i = 0; i < m; ++i) {
    const std::size_t k = normals_.row_of(i);
    const double scale = normals_.scale(i);
    base_gradient_[k] = static_cast<float>(gap_[i]);
    lower_[k] =
        points[i].grasped ? -std::numeric_limits<float>::infinity() : static_cast<float>(-start_[i] / scale);
    within_[k] = static_cast<float>(std::min(scale * tolerance, never_more / scale));
    change_[k] = points[i].grasped ? 0.0f : std::max(0.0f, lower_[k]);
  }
  const bool solved = minimise_over_bounds(normals_.values(), n, normals_.ld(), normals_.norm(),
                                           normals_.inverse(), base_gradient_, lower_, within_, change_,
                                           {gradient_, way_, product_, free_, downhill_}) >= 0 ||
                      pivot(points);
  for (std::size_t i = 0; i < m; ++i) {
    const std::size_t k = normals_.row_of(i);
    pressure_[i] =
        change_[k] <= lower_[k] ? 0 : start_[i] + normals_.scale(i) * static_cast<double>(change_[k]);
  }
  return solved;
}

// The same by factors, for what gradients do not solve: a node held from two sides has no stiffness of its
// own between them.
bool ContactSolver::pivot(std::span<const ContactPoint> points) noexcept {
  const std::size_t m = points.size();
  const auto row = [&](std::size_t i) { return normals_.row_of(i); };
  const auto from = [&](std::size_t i) { return points[i].grasped ? 0 : lower_[row(i)]; };
  for (std::size_t i = 0; i < m; ++i) {
    without_[i] = static_cast<double>(base_gradient_[row(i)]);
    for (std::size_t j = 0; j < m; ++j) {
      const auto c = static_cast<double>(normals_.between(i, j));
      system_[i * m + j] = i == j && !points[i].grasped ? c * (1 + 1e-6) : c;
      without_[i] += c * static_cast<double>(from(j));
    }
    active_[i] = points[i].grasped ? bilateral : change_[row(i)] > lower_[row(i)];
    pressure_[i] = static_cast<double>(change_[row(i)] - from(i));
  }
  const ComplementarityWork work{{factor_.data(), m * m}, {along_.data(), m}, {index_.data(), m}};
  const bool solved =
      solve_complementarity(system_.data(), m, m, without_.data(), active_, pressure_, work) > 0;
  for (std::size_t i = 0; i < m; ++i) change_[row(i)] = from(i) + static_cast<float>(pressure_[i]);
  return solved;
}

// u_ of every point under the forces force_.
void ContactSolver::displace(const ContactBlock& block, std::span<const ContactPoint> points) noexcept {
  std::size_t n = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (force_[i] == Vec3::Zero()) continue;
    Index& load = load_of_[static_cast<std::size_t>(points[i].slot)];
    if (load < 0) load = static_cast<Index>(n), loaded_[n] = points[i].slot, load_[n++].setZero();
    load_[static_cast<std::size_t>(load)] += force_[i];
  }
  for (std::size_t k = 0; k < n; ++k) load_of_[static_cast<std::size_t>(loaded_[k])] = -1;
  block.displacements({loaded_.data(), n}, {load_.data(), n}, along_);
  for (std::size_t i = 0; i < points.size(); ++i) u_[i] = block.in_planes<double>(along_, points[i].slot);
}

// The same of some of the points, in float32.
void ContactSolver::displace_some(const ContactBlock& block, std::span<const ContactPoint> points,
                                  const SolverLimits& limits) noexcept {
  clear(block, forces_);
  for (std::size_t i = 0; i < points.size(); ++i)
    if (force_[i] != Vec3::Zero()) add_in_planes(block, points[i].slot, force_[i], forces_);
  for (std::size_t i = 0; i < points.size(); ++i)
    if (is_exact(points[i], limits.exact_each, limits.exact_first))
      u_[i] = block.displacement(points[i].slot, forces_);
}

// The forces for the gaps and normals at the points' u, what they do (u_, force_, pressure_), and how far
// that is from the law: the minimum of the elastic energy under the linearised gaps.
ContactSolver::Step ContactSolver::propose(const ContactBlock& block, std::span<const PlacedShape> shapes,
                                           std::span<const ContactPoint> points, double tolerance) noexcept {
  const std::size_t m = points.size();
  normals_.update(block, points, 0);
  for (std::size_t i = 0; i < m; ++i) {
    const ContactPoint& c = points[i];
    start_[i] = start_of(c, c.force);
    gap_[i] = normals_.scale(i) * (c.gap / c.slope - c.normal.dot(c.u));
  }
  for (std::size_t j = 0; j < m; ++j)
    if (start_[j] != 0) {
      const double p = start_[j] / normals_.scale(j);
      for (std::size_t i = 0; i < m; ++i) gap_[i] += p * static_cast<double>(normals_.between(i, j));
    }
  Step s;
  s.solved = find_pressures(points, tolerance);
  for (std::size_t i = 0; i < m; ++i) force_[i] = pressure_[i] * points[i].normal;
  displace(block, points);
  measure(shapes, points, s);
  return s;
}

// reached_ and gone_ of the points at u_; trial_ for work space.
void ContactSolver::find_gaps(std::span<const PlacedShape> shapes,
                              std::span<const ContactPoint> points) noexcept {
  field_gaps(
      shapes, points, [&](std::size_t i) { return Vec3(points[i].rest + u_[i]); }, trial_, reached_);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ContactPoint& c = points[i];
    gone_[i] = c.path;
    reached_[i] = c.grasped || c.triangle >= 0 ? gap_of(shapes, c, u_[i])
                                               : gap_by_path(shapes[static_cast<std::size_t>(c.instrument)],
                                                             c.path, trial_[i], reached_[i], &gone_[i]);
  }
}

// How far u_ and pressure_ are from the law.
void ContactSolver::measure(std::span<const PlacedShape> shapes, std::span<const ContactPoint> points,
                            Step& s) noexcept {
  find_gaps(shapes, points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ContactPoint& c = points[i];
    const Gap& g = reached_[i];
    s.residual = std::max(s.residual, c.grasped || pressure_[i] > 0 ? std::abs(g.distance) : -g.distance);
    s.largest = std::max(s.largest, std::abs(pressure_[i]));
    if (c.grasped) continue;
    s.turned += pressure_[i] * (g.normal - c.normal).norm();
    s.total += pressure_[i];
  }
}

// Moves the points' paths to where they are now, and takes gap and normal there; measured: measure() has been
// at u_, where some of them still are.
void ContactSolver::relinearise(std::span<const PlacedShape> shapes, std::span<ContactPoint> points,
                                bool measured) noexcept {
  if (!measured) {
    for (std::size_t i = 0; i < points.size(); ++i) u_[i] = points[i].u;
    find_gaps(shapes, points);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    ContactPoint& c = points[i];
    Gap g = reached_[i];
    if (c.u != u_[i])
      g = gap_of(shapes, c, c.u, &c.path);
    else if (measured || c.foreseen_u == Vec3::Zero())  // where it is only foreseen to be it has not gone
      c.path = gone_[i];
    c.gap = g.distance, c.normal = g.normal, c.slope = g.slope;
  }
}

// Elastic energy plus what penetration costs, J, at trial_ and trial_force_: a step may only lower it.
double ContactSolver::merit(std::span<const PlacedShape> shapes, std::span<const ContactPoint> points,
                            double penalty) const noexcept {
  double energy = 0, inside = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    energy += 0.5 * trial_[i].dot(trial_force_[i]);
    const double gap = distance_of(shapes, points[i], trial_[i]);
    inside += (points[i].grasped ? std::abs(gap) : std::max(0.0, -gap)) / points[i].slope;
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
    last_u_[i] = last_force_[i] = last_change_[i] = Vec3::Zero();
  }
  while (result.relinearisations < limits.max_relinearisations && !result.converged) {
    relinearise(shapes, points, result.relinearisations > 0);
    ++result.relinearisations;
    const Step s = propose(block, shapes, points, linear_share * limits.tolerance);
    result.converged = s.solved && s.residual <= limits.tolerance && s.turned <= 1e-3 * s.total;
    if (!result.converged && result.relinearisations < limits.max_relinearisations)
      result.relinearisations <= downhill ? advance(shapes, points, 1.5 * s.largest, history)
                                          : calm(points, result.relinearisations == downhill + 1);
  }
  hand_over(points, 0);
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
      Eigen::Map<Mat3, 0, Eigen::OuterStride<>>(system_.data() + 3 * i * n + 3 * j,
                                                Eigen::OuterStride<>(static_cast<Eigen::Index>(n))) =
          block.between(c.slot, points[j].slot).transpose();
  }
  ++result.relinearisations;
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
