#include "palpate/elasticity/hats.hpp"

#include <algorithm>
#include <map>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

double area(const TriangleMesh& surface, const Triangle& t) { return area_vector(surface, t).norm(); }

}  // namespace

std::vector<Vec3> hat_centroids(const TriangleMesh& surface) {
  std::vector<Vec3> moment(surface.vertices.size(), Vec3::Zero());
  for (const Triangle& t : surface.triangles) {
    Vec3 sum = Vec3::Zero();
    for (const Index v : t) sum += surface.vertices[at(v)];
    for (const Index v : t) moment[at(v)] += area(surface, t) / 12 * (sum + surface.vertices[at(v)]);
  }
  const std::vector<double> areas = vertex_areas(surface);
  for (std::size_t i = 0; i < moment.size(); ++i)
    moment[i] = areas[i] > 0 ? Vec3(moment[i] / areas[i]) : surface.vertices[i];
  return moment;
}

Eigen::SparseMatrix<double> hat_loads(const TriangleMesh& surface, std::span<const Index> surface_nodes,
                                      const ElementNodes& nodes, std::span<const Index> free_of,
                                      std::span<const Index> hats) {
  if (nodes.order != 2) throw Error(ErrorKind::internal, "hats are for quadratic tetrahedra");
  const std::vector<double> areas = vertex_areas(surface);
  // A hat times a displacement, by the rule of the middles of a triangle's sides: a third of the area times
  // 1/2 in the middles of the vertex' own sides, 0 in that of the other.
  std::vector<std::map<Index, double>> entries(surface.vertices.size());
  for (const Triangle& t : surface.triangles)
    for (std::size_t j = 0; j < 3; ++j) {
      const Index p = t[j], q = t[(j + 1) % 3];
      const Index middle = nodes.middle(surface_nodes[at(p)], surface_nodes[at(q)]);
      for (const Index v : {p, q}) entries[at(v)][middle] += area(surface, t) / 6 / areas[at(v)];
    }
  std::vector<Eigen::Triplet<double>> triplets;
  for (std::size_t j = 0; j < hats.size(); ++j)
    for (const auto& [node, value] : entries[at(hats[j])])
      if (const Index row = free_of[at(node)]; row >= 0)
        for (Index a = 0; a < 3; ++a)
          triplets.emplace_back(3 * row + a, 3 * static_cast<Index>(j) + a, value);
  const auto free = std::count_if(free_of.begin(), free_of.end(), [](Index i) { return i >= 0; });
  Eigen::SparseMatrix<double> loads(3 * free, static_cast<Eigen::Index>(3 * hats.size()));
  loads.setFromTriplets(triplets.begin(), triplets.end());
  return loads;
}

HatProjection::HatProjection(const TriangleMesh& surface, std::span<const Index> row_of) {
  std::vector<std::map<Index, double>> mass;  // rows; twelve times
  std::vector<double> diagonal;
  for (const Index row : row_of)
    if (row >= 0) mass.emplace_back(), diagonal.push_back(0);
  for (const Triangle& t : surface.triangles) {
    const double a = area(surface, t);
    for (const Index i : t) {
      const Index row = row_of[at(i)];
      if (row < 0) continue;
      diagonal[at(row)] += 2 * a;
      for (const Index j : t)
        if (i != j && row_of[at(j)] >= 0) mass[at(row)][row_of[at(j)]] += a;
    }
  }
  begin_.push_back(0);
  for (std::size_t r = 0; r < mass.size(); ++r) {
    for (const auto& [column, value] : mass[r])
      column_.push_back(column), weight_.push_back(static_cast<float>(value / diagonal[r]));
    begin_.push_back(static_cast<Index>(column_.size()));
  }
}

void HatProjection::operator()(std::span<const Eigen::Vector4f> means,
                               std::span<Eigen::Vector4f> displacement,
                               std::span<Eigen::Vector4f> work) const noexcept {
  // Over the diagonal, which is half the hat's area: (1 + W) x = 2 means.
  constexpr float middle = 1.25f, half = 0.75f;  // of the eigenvalues' range
  constexpr int steps = 8;
  const std::size_t n = rows();
  const auto residual = work.first(n), direction = work.subspan(n, n);
  const auto times_mass = [&](std::span<const Eigen::Vector4f> x, std::size_t r) {
    Eigen::Vector4f sum = x[r];
    for (Index e = begin_[r]; e < begin_[r + 1]; ++e) sum += weight_[at(e)] * x[at(column_[at(e)])];
    return sum;
  };
  std::copy(means.begin(), means.end(), displacement.begin());
  for (std::size_t r = 0; r < n; ++r) {
    residual[r] = 2 * means[r] - times_mass(displacement, r);
    direction[r] = residual[r] / middle;
  }
  float rho = half / middle;
  for (int step = 0; step < steps; ++step) {
    for (std::size_t r = 0; r < n; ++r) {
      displacement[r] += direction[r];
      residual[r] -= times_mass(direction, r);
    }
    const float next = 1 / (2 * middle / half - rho);
    for (std::size_t r = 0; r < n; ++r)
      direction[r] = next * rho * direction[r] + 2 * next / half * residual[r];
    rho = next;
  }
}

}  // namespace palpate
