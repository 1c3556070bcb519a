// Other people's programs for the same job, measured beside ours in one run. Each is its own object library
// (their compile flags must not reach ours) and optional: make_* returns null where a peer is not installed.
#pragma once

#include <Eigen/SparseCore>
#include <memory>
#include <span>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate::peers {

// Closest point of a surface, a point at a time.
class ClosestPoints {
 public:
  virtual ~ClosestPoints() = default;
  virtual void query(std::span<const Vec3> points, std::span<Vec3> closest,
                     std::span<double> distance) const = 0;
};
// Embree 3: its point query over a scene of triangles, closest point on a triangle by our callback. float32.
std::unique_ptr<ClosestPoints> make_embree(const TriangleMesh& mesh);

// Trilinear interpolation of a regular grid of distances.
class GridSampler {
 public:
  virtual ~GridSampler() = default;
  virtual void sample(std::span<const Vec3> points, std::span<double> out) const = 0;
};
// OpenVDB: tools::BoxSampler over a dense float grid, by a cached accessor. values: z fastest, n[0] n[1]
// n[2].
std::unique_ptr<GridSampler> make_openvdb(const Vec3& origin, double h, const std::array<std::int32_t, 3>& n,
                                          std::span<const float> values);

// A narrow band of distances about a surface.
class BandFill {
 public:
  virtual ~BandFill() = default;
  virtual std::size_t fill() = 0;  // by one thread; number of distances stored
};
// OpenVDB: tools::meshToVolume, `width` voxels to both sides, grid points at multiples of h.
std::unique_ptr<BandFill> make_openvdb_band(const TriangleMesh& mesh, double h, float width);

// Sparse Cholesky factorisation.
class Factorisation {
 public:
  virtual ~Factorisation() = default;
  // Analyses and factorises the matrix given to make_cholmod; the analysis is repeated each time.
  virtual void factor() = 0;
  // R^T A^-1 R by solves with `block` columns of R (loads) at a time; out: column-major, loads.cols()
  // squared. After factor().
  virtual void inverse_block(const Eigen::SparseMatrix<double>& loads, std::size_t block,
                             std::span<float> out) = 0;
};
// CHOLMOD: supernodal, METIS ordering, float64. matrix: both triangles stored.
std::unique_ptr<Factorisation> make_cholmod(const Eigen::SparseMatrix<double>& matrix);

}  // namespace palpate::peers
