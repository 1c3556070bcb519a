#include "palpate/simulation/strain.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <numeric>

#include "palpate/elasticity/stiffness.hpp"
#include "palpate/simulation/surface.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// Tetrahedron behind each triangle of the surface.
std::vector<std::size_t> tets_behind(const Organ& organ) {
  using Face = std::array<Index, 3>;
  std::vector<std::pair<Face, std::size_t>> faces;
  for (std::size_t i = 0; i < organ.surface.triangles.size(); ++i) {
    Face f;
    for (std::size_t k = 0; k < 3; ++k) f[k] = organ.surface_nodes[at(organ.surface.triangles[i][k])];
    std::sort(f.begin(), f.end());
    faces.push_back({f, i});
  }
  std::sort(faces.begin(), faces.end());
  std::vector<std::uint8_t> outside(organ.mesh.nodes.size(), 0);
  for (const Index n : organ.surface_nodes) outside[at(n)] = 1;
  std::vector<std::size_t> behind(faces.size(), 0);
  for (std::size_t t = 0; t < organ.mesh.tets.size(); ++t)
    for (std::size_t without = 0; without < 4; ++without) {
      Face f;
      for (std::size_t k = 0; k < 3; ++k) f[k] = organ.mesh.tets[t][(without + 1 + k) % 4];
      if (!outside[at(f[0])] || !outside[at(f[1])] || !outside[at(f[2])]) continue;
      std::sort(f.begin(), f.end());
      const auto found = std::lower_bound(faces.begin(), faces.end(), std::pair{f, std::size_t{0}});
      if (found != faces.end() && found->first == f) behind[found->second] = t;
    }
  return behind;
}

double largest_principal(const Mat3& strain) {
  Eigen::SelfAdjointEigenSolver<Mat3> solver;
  solver.computeDirect(strain, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().cwiseAbs().maxCoeff();
}

}  // namespace

StrainGauge::StrainGauge(const Organ& organ)
    : begin_(organ.surface_size() + 1, 0),
      readings_(organ.surface.triangles.size()),
      traction_(organ.surface_size(), Vec3f::Zero()) {
  const std::vector<std::size_t> behind = tets_behind(organ);
  const TriangleMesh& surface = organ.surface;
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    const Triangle& t = surface.triangles[i];
    const Vec3 area = area_vector(surface, t), normal = area.normalized();
    const Material& material = material_of(organ.mesh, organ.materials, behind[i]);
    Frame frame;
    frame.area = static_cast<float>(area.norm());
    frame.normal = normal.cast<float>();
    frame.lambda = static_cast<float>(material.lambda()), frame.mu = static_cast<float>(material.mu());
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 across = surface.vertices[at(t[(k + 2) % 3])] - surface.vertices[at(t[(k + 1) % 3])];
      frame.gradient[k] = (normal.cross(across) / (2 * area.norm())).cast<float>();
      ++begin_[at(t[k]) + 1];
    }
    frames_.push_back(frame);
  }
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  triangles_.resize(3 * surface.triangles.size());
  std::vector<Index> next(begin_.begin(), begin_.end() - 1);
  for (std::size_t i = 0; i < surface.triangles.size(); ++i)
    for (const Index v : surface.triangles[i]) triangles_[at(next[at(v)]++)] = static_cast<Index>(i);
}

// Traction s = (lambda tr H + mu (H + H')) n. With H = H_s + c n', H_s along the surface, H_s n = 0: its
// part along n gives c.n, the rest c's.
const ContactStrain& StrainGauge::read(const Organ& organ, std::size_t triangle,
                                       std::span<const Vec3f> displacement) noexcept {
  Reading& reading = readings_[triangle];
  if (reading.number == number_) return reading.strain;
  reading.number = number_;
  const Frame& frame = frames_[triangle];
  Mat3 h = Mat3::Zero();
  Vec3 s = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t v = at(organ.surface.triangles[triangle][k]);
    h += displacement[v].cast<double>() * frame.gradient[k].cast<double>().transpose();
    s += traction_[v].cast<double>() / 3;
  }
  const Vec3 n = frame.normal.cast<double>();
  const double lambda = static_cast<double>(frame.lambda), mu = static_cast<double>(frame.mu);
  const Vec3 c =
      -h.transpose() * n + (s - s.dot(n) * n) / mu + (s.dot(n) - lambda * h.trace()) / (lambda + 2 * mu) * n;
  h += c * n.transpose();
  const Mat3 linear = 0.5 * (h + h.transpose()), quadratic = 0.5 * h.transpose() * h;
  reading.strain = {
      static_cast<float>(std::max(largest_principal(linear), largest_principal(linear + quadratic))),
      static_cast<float>(linear.norm()), static_cast<float>(quadratic.norm())};
  return reading.strain;
}

void StrainGauge::operator()(const Organ& organ, const Loads& loads, std::span<const Vec3f> displacement,
                             Strains& strains) noexcept {
  ++number_;
  strains.largest = 0;
  const auto node_of = [&](std::size_t i) { return at(organ.node_of_row[at(loads.rows[i])]); };
  for (std::size_t i = 0; i < loads.count; ++i)
    traction_[node_of(i)] = (loads.forces[i] / organ.areas[node_of(i)]).cast<float>();
  for (std::size_t i = 0; i < loads.count; ++i) {
    const std::size_t node = node_of(i);
    ContactStrain& strain = strains.contacts[i];
    strain = {};
    float area = 0;
    for (Index k = begin_[node]; k < begin_[node + 1]; ++k) {
      const std::size_t triangle = at(triangles_[at(k)]);
      const ContactStrain& of = read(organ, triangle, displacement);
      const float weight = frames_[triangle].area;
      strain.largest = std::max(strain.largest, of.largest);
      strain.linear += weight * of.linear, strain.quadratic += weight * of.quadratic;
      area += weight;
    }
    if (area > 0) strain.linear /= area, strain.quadratic /= area;
    strains.largest = std::max(strains.largest, static_cast<double>(strain.largest));
  }
  for (std::size_t i = 0; i < loads.count; ++i) traction_[node_of(i)].setZero();
}

}  // namespace palpate
