// A lattice for big grids: exact samples in a narrow band of bricks about the surface, and one distance a
// brick elsewhere, from which a lower bound follows (the distance changes by no more than the way). Bricks:
// Museth, "VDB: high-resolution sparse volumes with dynamic topology" (2013), with a single level.
#pragma once

#include <filesystem>
#include <string>

#include "palpate/lattice/lattice.hpp"

namespace palpate {

constexpr int brick = 8;  // points along a side
constexpr std::size_t brick_points = brick * brick * brick;

// Exact samples, float64.
struct BandSamples {
  Grid grid;
  double band = 0;                       // m: wherever the surface is nearer, the answer is an interpolation
  std::array<std::int32_t, 3> bricks{};  // along x, y, z
  std::vector<double> center;            // exact signed distance at each brick's centre, z fastest, m
  std::vector<std::int32_t> slot;        // of each brick; -1: no samples
  std::vector<double> distance;          // brick_points a slot, z fastest, m; beyond the grid too
  std::vector<Vec3> closest;             // m
  std::vector<Vec3> gradient;            // unit: away from the closest point, on the surface its pseudonormal
  SignMethod sign = SignMethod::pseudonormal;

  std::size_t slots() const { return distance.size() / brick_points; }
};

// band: m, at least the grid's spacing. Same bits for any number of threads. Throws Error(usage), and
// Error(resource) before the work when there is not the memory for it.
BandSamples sample_band(const SignedDistanceField& surface, const Grid& grid, double band, int threads = 0,
                        const Progress& progress = {});
// At random points nearer to the surface than the band, as far as `points` tries find any.
InterpolationError estimate_error(const SignedDistanceField& surface, const BandSamples& samples, int points,
                                  std::uint64_t seed = 1);

// As Lattice where the surface is nearer than the band. Elsewhere the distance is a lower bound of the true
// one with the right sign, less by a brick's diagonal at most, and neither continuous nor zero; its gradient
// is the way between the bricks' centres, of unit length.
class BandLattice {
 public:
  explicit BandLattice(const BandSamples& samples);
  const Grid& grid() const { return grid_; }
  double band() const { return band_; }
  SignMethod sign() const { return sign_; }
  std::size_t bytes() const;

  double distance(const Vec3& p) const noexcept;
  LatticeSample sample(const Vec3& p) const noexcept;
  LatticeSample smooth(const Vec3& p) const noexcept;
  std::optional<Vec3> closest(const Vec3& p) const noexcept;  // in the band only
  void distance(std::span<const Vec3> points, std::span<double> out) const noexcept;
  void sample(std::span<const Vec3> points, std::span<LatticeSample> out) const noexcept;

 private:
  using Point = std::array<std::int32_t, 3>;
  std::size_t brick_of(const Point& at) const noexcept;
  std::int64_t number(const Point& at) const noexcept;  // of its sample; -1: none
  // Numbers of the samples at a cell's corners; false: some have none.
  bool corners(const Point& first, std::array<std::size_t, 8>& at) const noexcept;
  LatticeSample far(const Vec3& p, const Point& near) const noexcept;

  Grid grid_;
  double band_;
  std::array<std::int32_t, 3> bricks_;
  std::vector<double> center_;
  std::vector<std::int32_t> slot_;
  HugeVector<float> distance_;
  HugeVector<Vec3f> closest_, gradient_;
  SignMethod sign_;
};

// HDF5, kind "band lattice", layout in docs/lattice.md.
void write_band(const std::filesystem::path& path, const BandSamples& samples, const TriangleMesh& surface,
                const std::string& provenance);
bool is_band_file(const std::filesystem::path& path);  // by content
struct BandFile {
  BandSamples samples;
  TriangleMesh surface;
  std::string provenance;
};
// Throws Error(file), Error(format).
BandFile read_band(const std::filesystem::path& path);

}  // namespace palpate
