#include "palpate/simulation/surface.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

}  // namespace

double Loads::work() const noexcept {
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) sum += forces[i].dot(u[i]);
  return sum;
}

void Loads::copy(const Loads& other) noexcept {
  count = other.count, number = other.number, u_known = other.u_known;
  std::copy_n(other.rows.begin(), count, rows.begin());
  std::copy_n(other.forces.begin(), count, forces.begin());
  std::copy_n(other.u.begin(), count, u.begin());
}

Surface make_surface(const Organ& organ) {
  const std::size_t s = organ.surface_size();
  std::vector<float> softness(s, 0.0f);
  for (std::size_t r = 0; r < organ.compliance.nodes(); ++r) {
    const auto row = static_cast<Index>(r);
    Eigen::Matrix3f c;
    organ.compliance.block({&row, 1}, {c.data(), 9}, 3);
    const float most =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f>(c, Eigen::EigenvaluesOnly).eigenvalues()[2];
    softness[at(organ.node_of_row[r])] = std::sqrt(std::max(0.0f, most)) * (1 + 1e-4f);
  }
  Surface surface;
  surface.loads = Loads(s);
  surface.displacement.assign(s, Vec3f::Zero());
  surface.reading = surface.displacement;
  surface.positions = organ.contact_points;
  surface.strains.contacts.resize(s);
  surface.clusters = std::make_shared<const Clusters>(organ.contact_points, organ.node_of_row, 32, softness);
  surface.bounds = ClusterBounds(*surface.clusters);
  surface.bounds.update(*surface.clusters, surface.positions);
  surface.changes.fill({std::vector<Vec3>(s, Vec3::Zero()), ClusterBounds(*surface.clusters)});
  return surface;
}

Deformer::Deformer(const Organ& organ)
    : compliance_(organ.compliance.with_work()),
      gauge_(organ),
      forces_(3 * organ.surface_size()),
      u_(3 * organ.compliance.nodes()),
      last_(organ.surface_size()),
      last_u_(u_.size()),
      last_moved_(organ.surface_size(), Vec3::Zero()),
      means_(organ.projection.rows(), Eigen::Vector4f::Zero()),
      drawn_(means_.size()),
      work_(2 * means_.size()) {}

void Deformer::operator()(const Organ& organ, const Loads& loads, Surface& surface) noexcept {
  const std::size_t n = loads.count;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t a = 0; a < 3; ++a)
      forces_[3 * i + a] = static_cast<float>(loads.forces[i][static_cast<int>(a)]);
  (compliance_.same_numbers(organ.compliance) ? compliance_ : organ.compliance)
      .apply({loads.rows.data(), n}, {forces_.data(), 3 * n}, u_);
  for (std::size_t i = 0; i < n && loads.u_known; ++i)  // these are known in float64
    for (std::size_t a = 0; a < 3; ++a)
      u_[3 * at(loads.rows[i]) + a] = static_cast<float>(loads.u[i][static_cast<int>(a)]);
  for (std::size_t r = 0; r < organ.compliance.nodes(); ++r) {
    const std::size_t node = at(organ.node_of_row[r]);
    surface.reading[node] = Vec3f(u_[3 * r], u_[3 * r + 1], u_[3 * r + 2]);
    surface.positions[node] = organ.contact_points[node] + surface.reading[node].cast<double>();
  }
  if (organ.order == 1) {
    std::copy(surface.reading.begin(), surface.reading.end(), surface.displacement.begin());
  } else {
    for (std::size_t r = 0; r < means_.size(); ++r)
      means_[r].head<3>() = surface.reading[at(organ.node_of_row[r])];
    organ.projection(means_, drawn_, work_);
    for (std::size_t r = 0; r < means_.size(); ++r)
      surface.displacement[at(organ.node_of_row[r])] = drawn_[r].head<3>();
  }
  surface.bounds.update(*surface.clusters, surface.positions);
  find_changes(organ, loads, surface);
  surface.loads.copy(loads);
  gauge_(organ, loads, surface.displacement, surface.strains);
}

void Deformer::find_changes(const Organ& organ, const Loads& loads, Surface& surface) noexcept {
  for (Change& change : surface.changes) change.work = 0;
  if (!compliance_.same_numbers(organ.compliance)) return;
  auto& [most, besides] = surface.changes;
  const auto work_on = [&](const std::vector<Vec3>& moved) {
    return loads.work_on(organ.node_of_row, moved) - last_.work_on(organ.node_of_row, moved);
  };
  for (std::size_t r = 0; r < organ.compliance.nodes(); ++r)
    for (std::size_t a = 0; a < 3; ++a)
      most.moved[at(organ.node_of_row[r])][static_cast<int>(a)] =
          static_cast<double>(u_[3 * r + a]) - static_cast<double>(last_u_[3 * r + a]);
  most.work = work_on(most.moved), besides.work = std::exchange(last_work_, most.work);
  const double both = work_on(last_moved_);
  besides.moved = last_moved_, last_moved_ = most.moved;
  if (most.work < besides.work) std::swap(most, besides);
  // No more than 1 but for rounding (Cauchy, Schwarz).
  const double share = most.work > 0 ? std::clamp(both / most.work, -1.0, 1.0) : 0;
  for (std::size_t i = 0; i < most.moved.size(); ++i) besides.moved[i] -= share * most.moved[i];
  besides.work -= share * both;
  for (Change& change : surface.changes) {
    change.bounds.update(*surface.clusters, change.moved);
    change.of_loads = loads.work_on(organ.node_of_row, change.moved);
  }
  last_.copy(loads), std::swap(last_u_, u_);
}

}  // namespace palpate
