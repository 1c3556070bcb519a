// A rigid body as a regular grid of signed distances and closest surface points (T 5.1.1, 5.2).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "palpate/base/huge_array.hpp"
#include "palpate/base/progress.hpp"
#include "palpate/base/simd.hpp"
#include "palpate/base/vec.hpp"
#include "palpate/geometry/signed_distance.hpp"
#include "palpate/lattice/lattice_batch.hpp"

namespace palpate {

// Regular grid: point (i, j, k) lies at origin + h (i, j, k) and has number (i*n[1] + j)*n[2] + k, z fastest.
struct Grid {
  using Points = std::array<std::int32_t, 3>;
  Vec3 origin = Vec3::Zero();  // m
  double h = 0;                // m
  Points n{};                  // points along x, y, z; at least 2

  std::size_t size() const { return std::size_t(n[0]) * std::size_t(n[1]) * std::size_t(n[2]); }
  Vec3 point(int i, int j, int k) const { return origin + h * Vec3(i, j, k); }
  std::size_t number(const Points& at) const { return number(n, at); }
  static std::size_t number(const Points& n, const Points& at) {
    return (std::size_t(at[0]) * std::size_t(n[1]) + std::size_t(at[1])) * std::size_t(n[2]) +
           std::size_t(at[2]);
  }
  Box box() const { return {origin, point(n[0] - 1, n[1] - 1, n[2] - 1)}; }
};

// h = shortest side of the box / subdivisions; origin at the box's corner less `margin` (m, all sides);
// the other sides grow to a multiple of h (DESIGN: T 5.1.1).
// Throws Error(usage), Error(geometry) when the box is flat or empty, Error(resource) above a million points
// a side.
Grid make_grid(const Box& box, int subdivisions, double margin = 0);
// The same with h given.
Grid make_grid_spaced(const Box& box, double h, double margin = 0);

// Exact samples, float64: what is computed and written (offline).
struct LatticeSamples {
  Grid grid;
  std::vector<double> distance;  // m, negative inside, one a grid point
  std::vector<Vec3> closest;     // m, closest surface point of each grid point
  // Grid points on the surface itself (|distance| < 1e-6 h), ascending, with the surface's pseudonormal
  // there: p - closest says nothing. Empty where unknown (text): then differences of the distances serve.
  std::vector<std::size_t> touching;
  std::vector<Vec3> touching_normal;
  SignMethod sign = SignMethod::pseudonormal;
};

// Exact distance at every grid point. `threads` 0: all processors. Same bits for any number of threads.
LatticeSamples sample_lattice(const SignedDistanceField& surface, const Grid& grid, int threads = 0,
                              const Progress& progress = {});

struct InterpolationError {
  double max = 0, rms = 0;  // m, |trilinear - exact| over `points` random points within the box
};
InterpolationError estimate_error(const SignedDistanceField& surface, const LatticeSamples& samples,
                                  int points, std::uint64_t seed = 1);

// Distance and its gradient at a point.
struct LatticeSample {
  double distance = 0;           // m
  Vec3 gradient = Vec3::Zero();  // of the distance
};

// What is asked online: immutable, thread-safe, no allocation. float32 storage.
class Lattice {
 public:
  // float16: distances in units of h are stored in half precision besides (8 bytes a point), off by at most
  // 5e-4 |d|, for the batches below: half the time where the grid is larger than the caches.
  enum class Storage : std::uint8_t { float32, float16 };
  explicit Lattice(const LatticeSamples& samples, Storage storage = Storage::float32);
  const Grid& grid() const { return grid_; }
  SignMethod sign() const { return sign_; }

  // Trilinear interpolation (T 5.2.2). Outside the box, where the surface is in it: continuous, never less
  // than the distance to the box, and from h/sqrt(2) outside a lower bound of the distance (nearer, it
  // exceeds that by less than the interpolation error on the box). NaN where p is no number.
  double distance(const Vec3& p) const noexcept;
  // The trilinear distance, and a gradient that is continuous across cells: trilinear interpolation of the
  // exact gradients (p - closest)/distance at the grid points, normalised; for contact, where the
  // interpolant's own gradient jumps between cells and makes Newton cycle. Outside the box it turns towards
  // the way from the box. Always of unit length; on the medial axis some corner's.
  LatticeSample sample(const Vec3& p) const noexcept;
  // For contact: a distance whose own gradient is continuous and has no waves, so that a solver on it comes
  // to rest: the quadratic B-spline with the samples as its coefficients (de Boor, A Practical Guide to
  // Splines, 1978), over the 27 nearest grid points. Convex stays convex; off by h^2/8 times the sum of the
  // principal curvatures (the trilinear one by as much), and rounds edges over a cell. The gradient is that
  // of this distance, not normalised. Outside the box as sample().
  LatticeSample smooth(const Vec3& p) const noexcept;
  // The same bits for many points.
  void smooth(std::span<const Vec3> points, std::span<LatticeSample> out) const noexcept;
  // smooth().distance is no less, by up to 2.6 h; from one grid point, so many times faster.
  double lower_bound(const Vec3& p) const noexcept;
  // Of fourth order where the distance is smooth: interpolates the exact gradients too. Where they disagree
  // (medial axis, sharp edges) as trilinear. The gradient is that of this distance, not normalised. In
  // float32. Outside the box as sample().
  LatticeSample hermite(const Vec3& p) const noexcept;
  // Many points at once, in float32: the fast form. The distance as distance() or hermite(), the gradient the
  // interpolant's own (neither normalised nor, if trilinear, continuous), the closest point as closest(), no
  // number where that has none. Outside the box as sample(). Spans that are not wanted may be empty, the
  // others are as long as `points`. The same bits by every instruction set.
  struct Batch {
    std::span<float> distance{};  // m
    std::span<Vec3f> gradient{};
    std::span<Vec3f> closest{};  // m
  };
  void sample(std::span<const Vec3f> points, const Batch& out, Interpolation how = Interpolation::trilinear,
              Simd simd = best_simd()) const noexcept;
  void distance(std::span<const Vec3> points, std::span<double> out) const noexcept;
  void sample(std::span<const Vec3> points, std::span<LatticeSample> out) const noexcept;
  // Interpolated closest point, when the eight corners' lie within 2 h of each other and the lattice's own
  // distance there is below h/10; empty outside the box and across the medial axis, where an interpolated
  // point means nothing (T 7.2 point 3).
  std::optional<Vec3> closest(const Vec3& p) const noexcept;

 private:
  // The distance again, beside its unit gradient: what is read together.
  struct alignas(16) Jet {
    float distance;
    Vec3f gradient;
  };
  BatchView view() const noexcept;
  LatticeSample smooth_anywhere(const Vec3& p) const noexcept;
  Grid grid_;
  Grid::Points stored_;  // places along x, y, z in what follows: the grid's or a few more
  HugeVector<float> distance_;
  HugeVector<Vec3f> closest_;
  HugeVector<Jet> jets_;
  HugeVector<std::uint64_t> quads_;  // float16: four distances in units of h, at (i, j), (i, j+1), (i+1, j),
                                     // (i+1, j+1), from the lowest bits; two points hold a cell
  SignMethod sign_;
};

}  // namespace palpate
