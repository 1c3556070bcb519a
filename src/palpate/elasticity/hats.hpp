// How quadratic tetrahedra are loaded and read on the surface: through the linear hats of its vertices. A
// force on vertex i is a traction spread as its hat, consistent with the quadratic shape functions; the
// displacement that is its work partner is the mean over the hat. DESIGN 5; Brenner, Scott, The Mathematical
// Theory of Finite Element Methods (2008), ch. 4 (projection).
#pragma once

#include <Eigen/SparseCore>
#include <span>
#include <vector>

#include "palpate/elasticity/element_nodes.hpp"
#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

// Where hats are read: the mean position over each vertex' hat, m. A displacement that is linear in space has
// there the value that is its mean over the hat.
std::vector<Vec3> hat_centroids(const TriangleMesh& surface);

// Column 3 j + a: the nodal forces of a unit force along axis a on vertex hats[j], 3 rows a free node. Sums
// to one but for what falls on anchored nodes. surface_nodes: the mesh's node of each vertex; free_of: number
// of each node among the free ones, -1 where anchored.
Eigen::SparseMatrix<double> hat_loads(const TriangleMesh& surface, std::span<const Index> surface_nodes,
                                      const ElementNodes& nodes, std::span<const Index> free_of,
                                      std::span<const Index> hats);

// The displacements of the vertices whose piecewise linear field has given means over the hats: the L2
// projection of the displacement onto the drawn surface. Exact for fields that are linear in space. Vertices
// without a row stay where they are.
class HatProjection {
 public:
  HatProjection() = default;
  // row_of: row of each vertex, -1: none.
  HatProjection(const TriangleMesh& surface, std::span<const Index> row_of);
  // means: of each row, m; displacement: of each row's vertex, m; work: two vectors a row. The mass matrix
  // over its diagonal has eigenvalues in 1/2 .. 2 (Wathen 1987), so eight steps of Chebyshev's iteration
  // leave 3e-4 of what means and displacements differ by.
  void operator()(std::span<const Eigen::Vector4f> means, std::span<Eigen::Vector4f> displacement,
                  std::span<Eigen::Vector4f> work) const noexcept;
  std::size_t rows() const noexcept { return begin_.empty() ? 0 : begin_.size() - 1; }

 private:
  std::vector<Index> begin_, column_;  // of each row, without the diagonal
  std::vector<float> weight_;          // mass matrix over its diagonal
};

}  // namespace palpate
