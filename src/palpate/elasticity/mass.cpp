#include "palpate/elasticity/mass.hpp"

#include "palpate/elasticity/gradients.hpp"
#include "palpate/elasticity/stiffness.hpp"

namespace palpate {

namespace {

// Products of two shape functions over a tetrahedron, over its volume.
double product(std::size_t i, std::size_t j, int order) {
  if (order == 1) return i == j ? 0.1 : 0.05;
  // Barycentric coordinates integrate to 3! a! b! c! d! / (a + b + c + d + 3)!, times the volume.
  if (i > j) std::swap(i, j);
  const auto on = [](std::size_t corner, std::size_t middle) {
    return tet_edges[middle - 4][0] == corner || tet_edges[middle - 4][1] == corner;
  };
  if (j < 4) return (i == j ? 6 : 1) / 420.0;
  if (i < 4) return (on(i, j) ? -4 : -6) / 420.0;
  if (i == j) return 32 / 420.0;
  return (on(tet_edges[i - 4][0], j) || on(tet_edges[i - 4][1], j) ? 16 : 8) / 420.0;
}

}  // namespace

Eigen::SparseMatrix<double> assemble_mass(const TetMesh& mesh, const ElementNodes& nodes,
                                          const std::vector<Material>& materials) {
  require_valid(mesh, materials);
  const std::size_t n = nodes.per_tet();
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(n * n * mesh.tets.size());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const double mass =
        material_of(mesh, materials, t).density * gradients(corners_of(mesh, mesh.tets[t])).volume;
    const auto of = nodes.of(t);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j)
        entries.emplace_back(of[i], of[j], mass * product(i, j, nodes.order));
  }
  const auto size = static_cast<Eigen::Index>(nodes.size());
  Eigen::SparseMatrix<double> out(size, size);
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

}  // namespace palpate
