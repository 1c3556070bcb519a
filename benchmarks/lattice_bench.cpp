// Building and asking lattices. A torus of 200,000 triangles in a cubic grid.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <random>

#include "bench.hpp"
#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/lattice/band_lattice.hpp"
#include "palpate/lattice/lattice.hpp"
#include "peers.hpp"

namespace palpate {

namespace {

constexpr double major_radius = 0.06, minor_radius = 0.02;  // m

// n x n x n points about the torus.
Grid cube_grid(int n) {
  const double half = 1.02 * (major_radius + minor_radius);
  return {Vec3::Constant(-half), 2 * half / (n - 1), {n, n, n}};
}

// The exact smooth torus: samples for query rows in no time.
LatticeSamples smooth_torus(const Grid& grid) {
  LatticeSamples samples;
  samples.grid = grid;
  samples.distance.reserve(grid.size());
  samples.closest.reserve(grid.size());
  for (int i = 0; i < grid.n[0]; ++i)
    for (int j = 0; j < grid.n[1]; ++j)
      for (int k = 0; k < grid.n[2]; ++k) {
        const Vec3 p = grid.point(i, j, k);
        const double ring = std::hypot(p.x(), p.z());
        const Vec3 centre =
            ring > 0 ? Vec3(major_radius / ring * Vec3(p.x(), 0, p.z())) : Vec3(major_radius, 0, 0);
        const double d = (p - centre).norm();
        samples.distance.push_back(d - minor_radius);
        samples.closest.push_back(centre + minor_radius * (d > 0 ? Vec3((p - centre) / d) : Vec3(0, 1, 0)));
      }
  return samples;
}

// Embree answers the same points in the same order, closest points included, unsigned (it has no inside).
std::vector<Value> fill(int n, const Runs& runs) {
  const TriangleMesh torus = make_torus(major_radius, minor_radius, 400, 250);
  const Timer ours_build = cpu_timer();
  const SignedDistanceField field(torus);
  const double ours_seconds = ours_build.seconds();
  const Timer peer_build = cpu_timer();
  const auto embree = peers::make_embree(torus);
  const double peer_seconds = peer_build.seconds();

  const Grid grid = cube_grid(n);
  std::vector<Vec3> points, closest(grid.size());
  std::vector<double> distance(grid.size());
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) points.push_back(grid.point(i, j, k));
  LatticeSamples samples;
  const Medians m =
      in_turn([&] { samples = sample_lattice(field, grid, 1); },
              embree ? [&] { embree->query(points, closest, distance); } : std::function<void()>(), runs);
  if (embree)
    for (std::size_t i = 0; i < points.size(); ++i)
      if (std::abs(std::abs(samples.distance[i]) - distance[i]) > 1e-6)
        throw Error(ErrorKind::internal, "grid point {}: distance {} here, {} by Embree", i,
                    samples.distance[i], distance[i]);
  const double ns = 1e9 / static_cast<double>(grid.size());
  std::string note = fmt::format("search structure {:.0f} ms", 1e3 * ours_seconds);
  if (embree) note += fmt::format(", peer's {:.0f} ms", 1e3 * peer_seconds);
  return {{m.ours * ns, embree ? "Embree 3" : "", m.peer * ns, note}};
}

// A band of three cells to both sides, per point of the whole grid. OpenVDB has no closest points and no far
// field, and its distances are float32.
std::vector<Value> fill_band(int n, const Runs& runs) {
  const TriangleMesh torus = make_torus(major_radius, minor_radius, 400, 250);
  const SignedDistanceField field(torus);
  const Grid grid = cube_grid(n);
  const auto openvdb = peers::make_openvdb_band(torus, grid.h, 3);
  BandSamples samples;
  std::size_t stored = 0;
  const Medians m = in_turn([&] { samples = sample_band(field, grid, 3 * grid.h, 1); },
                            openvdb ? [&] { stored = openvdb->fill(); } : std::function<void()>(), runs);
  const double ns = 1e9 / static_cast<double>(grid.size());
  std::string note = fmt::format("{} points sampled", samples.distance.size());
  if (openvdb) note += fmt::format(", {} by the peer, distances only", stored);
  return {{m.ours * ns, openvdb ? "OpenVDB meshToVolume" : "", m.peer * ns, note}};
}

// Wall-clock time of one thread over that of two.
std::vector<Value> two_threads(int n) {
  const TriangleMesh torus = make_torus(major_radius, minor_radius, 400, 250);
  const SignedDistanceField field(torus);
  const Grid grid = cube_grid(n);
  std::vector<double> one, two;
  for (int i = 0; i < 5; ++i)
    for (const int threads : {1, 2}) {
      const Timer timer = wall_timer();
      sample_lattice(field, grid, threads);
      (threads == 1 ? one : two).push_back(timer.seconds());
    }
  std::sort(one.begin(), one.end()), std::sort(two.begin(), two.end());
  const double ns = 1e9 / static_cast<double>(grid.size());
  return {{two[2] * ns, "one thread, ours", one[2] * ns, "wall-clock time"}};
}

// Interleaved bits of the cell: neighbours in space are neighbours in the list.
std::uint64_t morton(const Grid& grid, const Vec3f& p) {
  std::uint64_t code = 0;
  for (int a = 0; a < 3; ++a) {
    const auto x = static_cast<std::uint64_t>((static_cast<double>(p[a]) - grid.origin[a]) / grid.h);
    for (unsigned bit = 0; bit < 20; ++bit) code |= (x >> bit & 1u) << (3 * bit + static_cast<unsigned>(a));
  }
  return code;
}

// A million points. Ours are float32, as contact would hand them over; the peer converts its own beforehand.
std::vector<Value> query(int n, bool sorted, Lattice::Storage storage) {
  const LatticeSamples samples = smooth_torus(cube_grid(n));
  const Lattice lattice(samples, storage);
  const Grid& grid = lattice.grid();
  const auto openvdb = peers::make_openvdb(
      grid.origin, grid.h, grid.n, std::vector<float>(samples.distance.begin(), samples.distance.end()));
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0.0, grid.h * (n - 1) * (1 - 1e-6));
  std::vector<Vec3f> points(1000000);
  for (Vec3f& p : points) p = (grid.origin + Vec3(unit(random), unit(random), unit(random))).cast<float>();
  if (sorted)
    std::sort(points.begin(), points.end(),
              [&](const Vec3f& a, const Vec3f& b) { return morton(grid, a) < morton(grid, b); });
  std::vector<Vec3> peer_points;
  for (const Vec3f& p : points) peer_points.push_back(p.cast<double>());
  std::vector<float> out(points.size()), again(points.size());
  std::vector<Vec3f> gradient(points.size());
  std::vector<double> peer_out(points.size());
  const Runs runs{5, 15, 2, 3};
  const auto peer = openvdb ? [&] { openvdb->sample(peer_points, peer_out); } : std::function<void()>();
  const Medians m = in_turn([&] { lattice.sample(points, {out, {}, {}}); }, peer, runs);
  const Medians g = in_turn([&] { lattice.sample(points, {again, gradient, {}}); }, {}, runs);
  const double allowed =
      storage == Lattice::Storage::float16 ? 1e-3 : 4e-5;  // float32 knows a place in 256 cells to 2e-5
  if (openvdb)
    for (std::size_t i = 0; i < points.size(); ++i)
      if (std::abs(static_cast<double>(out[i]) - peer_out[i]) >
          allowed * (std::abs(peer_out[i]) + 2 * grid.h))
        throw Error(ErrorKind::internal, "point {}: distance {} here, {} by OpenVDB", i, out[i], peer_out[i]);
  const double ns = 1e9 / static_cast<double>(points.size());
  return {{m.ours * ns, openvdb ? "OpenVDB BoxSampler" : "", m.peer * ns}, {g.ours * ns}};
}

std::vector<Value> hermite(int n) {
  const Lattice lattice(smooth_torus(cube_grid(n)));
  const Grid& grid = lattice.grid();
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0.0, grid.h * (n - 1) * (1 - 1e-6));
  std::vector<Vec3f> points(1000000);
  for (Vec3f& p : points) p = (grid.origin + Vec3(unit(random), unit(random), unit(random))).cast<float>();
  std::vector<float> distance(points.size());
  std::vector<Vec3f> gradient(points.size());
  const double ns = 1e9 / static_cast<double>(points.size());
  const Medians batch = in_turn([&] {
    lattice.sample(points, {distance, gradient, {}}, Interpolation::hermite);
  });
  const Medians single = in_turn([&] {
    for (std::size_t i = 0; i < points.size(); ++i)
      distance[i] = static_cast<float>(lattice.hermite(points[i].cast<double>()).distance);
  });
  return {{batch.ours * ns, "Discregrid cubic, recorded", n == 64 ? 545 : no_peer, "with gradient"},
          {single.ours * ns, "", no_peer, "a point at a time"}};
}

}  // namespace

void register_lattice(Bench& bench) {
  bench.add({{"lattice.fill.torus200k.28", "ns/point"}}, [] { return fill(28, {3, 9, 4}); });
  bench.add({{"lattice.fill.torus200k.128", "ns/point"}}, [] { return fill(128, {2, 3, 60}); });
  bench.add({{"lattice.fill.torus200k.128.band", "ns/point"}}, [] { return fill_band(128, {3, 9, 6}); });
  bench.add({{"lattice.fill.torus200k.128.threads2", "ns/point"}}, [] { return two_threads(128); });
  bench.add({{"lattice.query.64.random.hermite", "ns/query"},
             {"lattice.query.64.random.hermite.single", "ns/query"}},
            [] { return hermite(64); });
  for (const int n : {64, 256})
    for (const bool sorted : {false, true})
      for (const auto storage : {Lattice::Storage::float32, Lattice::Storage::float16}) {
        const std::string name = fmt::format("lattice.query.{}.{}.", n, sorted ? "sorted" : "random");
        const std::string half = storage == Lattice::Storage::float16 ? ".float16" : "";
        bench.add({{name + "distance" + half, "ns/query"}, {name + "gradient" + half, "ns/query"}},
                  [=] { return query(n, sorted, storage); });
      }
}

}  // namespace palpate
