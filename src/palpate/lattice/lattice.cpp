// Signed distance and closest point on a grid: T 5.1.1 (offline) and 5.2 (online).
#include "palpate/lattice/lattice.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>

#include "palpate/base/clones.hpp"
#include "palpate/base/parallel_for.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/lattice/cell.hpp"
#include "palpate/lattice/lattice_batch.hpp"

namespace palpate {

namespace {

constexpr double most_points_a_side = 1 << 20;

Grid grid_with(const Box& box, double h, double margin) {
  if (!(h > 0) || !std::isfinite(h)) throw Error(ErrorKind::usage, "the lattice's spacing must be positive");
  if (!(margin >= 0) || !std::isfinite(margin))
    throw Error(ErrorKind::usage, "the lattice's margin must not be negative");
  const Box grown = box.grown(margin);
  Grid grid{grown.min, h, {}};
  for (int k = 0; k < 3; ++k) {
    // A side that is a multiple of h but for rounding gets no extra cell.
    const double cells = std::ceil(grown.size()[k] / h * (1 - 1e-9));
    if (!(cells < most_points_a_side))
      throw Error(
          ErrorKind::resource,
          "a lattice with spacing {:.3g} m needs more than a million points along one side of {:.3g} m; "
          "use fewer subdivisions or a larger spacing",
          h, grown.size()[k]);
    grid.n[static_cast<std::size_t>(k)] = std::max(2, static_cast<int>(cells) + 1);
  }
  return grid;
}

// The eight corners of the cell that holds a point, z fastest: their places among `stored`.
struct Corners {
  std::array<std::size_t, 8> at;
  std::array<double, 8> weight;
  Corners(const Grid& grid, const Grid::Points& stored, const Vec3& p) noexcept {
    const Cell c = cell_at(grid, p);
    weight = trilinear(c.t);
    const std::size_t first = Grid::number(stored, c.at), row = Grid::number(stored, {0, 1, 0}),
                      sheet = Grid::number(stored, {1, 0, 0});
    for (std::size_t m = 0; m < 8; ++m) at[m] = first + (m >> 2) * sheet + (m >> 1 & 1) * row + (m & 1);
  }
  double mix(const auto& values) const noexcept {
    double sum = 0;
    for (std::size_t m = 0; m < 8; ++m) sum += weight[m] * static_cast<double>(values[at[m]]);
    return sum;
  }
  Vec3 mix(const HugeVector<Vec3f>& values) const noexcept {
    Vec3 sum = Vec3::Zero();
    for (std::size_t m = 0; m < 8; ++m) sum += weight[m] * values[at[m]].cast<double>();
    return sum;
  }
};

// Rows and sheets a power of two apart fall on the same few places of the caches. Small grids fit them
// anyway.
Grid::Points spread(Grid::Points n) {
  if (Grid::number(n, {n[0], 0, 0}) < std::size_t{1} << 21) return n;
  while (n[1] % 8 != 2) ++n[1];
  while (n[2] % 16 != 9) ++n[2];
  return n;
}

// Unit gradient by differences of the distances at the neighbours.
Vec3 difference(const LatticeSamples& s, const std::array<int, 3>& at) {
  const double d = s.distance[s.grid.number(at)];
  Vec3 axes = Vec3::Zero(), around = Vec3::Zero();
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      for (int k = -1; k <= 1; ++k) {
        const std::array<int, 3> to{at[0] + i, at[1] + j, at[2] + k};
        bool in = i != 0 || j != 0 || k != 0;
        for (std::size_t c = 0; c < 3; ++c) in = in && to[c] >= 0 && to[c] < s.grid.n[c];
        if (!in) continue;
        const Vec3 step(i, j, k);
        const Vec3 slope = (s.distance[s.grid.number(to)] - d) / step.squaredNorm() * step;
        around += slope;
        if (std::abs(i) + std::abs(j) + std::abs(k) == 1) axes += slope;
      }
  // At a box's edge on the grid's edge all neighbours along the axes are on the surface too.
  if (axes.norm() < 1e-6 * s.grid.h) axes = around;
  return axes.norm() > 0 ? Vec3(axes.normalized()) : Vec3::UnitZ();
}

constexpr double touches = 1e-6;  // times h: nearer, a grid point counts as on the surface

// Unit gradient at a grid point: away from the closest point; by differences where that says nothing, or
// where rounded text has it disagree with the distance.
Vec3 gradient_at(const LatticeSamples& s, const std::array<int, 3>& at) {
  const std::size_t i = s.grid.number(at);
  const double d = s.distance[i];
  const Vec3 away = s.grid.point(at[0], at[1], at[2]) - s.closest[i];
  const double length = away.norm();
  if (std::abs(d) >= touches * s.grid.h && std::abs(length - std::abs(d)) < 1e-3 * std::abs(d))
    return away / (d < 0 ? -length : length);
  const auto known = std::lower_bound(s.touching.begin(), s.touching.end(), i);
  if (known != s.touching.end() && *known == i)
    return s.touching_normal[static_cast<std::size_t>(known - s.touching.begin())];
  return difference(s, at);
}

}  // namespace

Grid make_grid(const Box& box, int subdivisions, double margin) {
  if (subdivisions < 1)
    throw Error(ErrorKind::usage, "subdivisions must be at least 1, not {}", subdivisions);
  if (box.empty()) throw Error(ErrorKind::geometry, "a lattice needs a box with something in it");
  const double shortest = box.size().minCoeff();
  if (!(shortest > 0))
    throw Error(ErrorKind::geometry,
                "the surface is flat: its box has no shortest side to subdivide; give the "
                "spacing instead");
  return grid_with(box, shortest / subdivisions, margin);
}

Grid make_grid_spaced(const Box& box, double h, double margin) {
  if (box.empty()) throw Error(ErrorKind::geometry, "a lattice needs a box with something in it");
  return grid_with(box, h, margin);
}

LatticeSamples sample_lattice(const SignedDistanceField& surface, const Grid& grid, int threads,
                              const Progress& progress) {
  const double bytes = static_cast<double>(sizeof(double) + sizeof(Vec3)) * grid.n[0] * grid.n[1] * grid.n[2];
  const auto available = static_cast<double>(available_bytes());
  if (bytes > available)
    throw Error(ErrorKind::resource,
                "a lattice of {} x {} x {} points needs {:.1f} GB of memory, {:.1f} are available; use fewer "
                "subdivisions or a larger spacing",
                grid.n[0], grid.n[1], grid.n[2], 1e-9 * bytes, 1e-9 * available);
  LatticeSamples samples;
  samples.grid = grid;
  samples.sign = surface.method();
  samples.distance.resize(grid.size());
  samples.closest.resize(grid.size());
  // A chunk is a tile of lines along z, walked to and fro, sheet by sheet, so that each point's neighbour was
  // asked just before. Where that was starts the search; the answer does not depend on it.
  constexpr int tile = 4;
  const auto tiles = [&](std::size_t axis) {
    return static_cast<std::size_t>((grid.n[axis] + tile - 1) / tile);
  };
  const std::size_t all_tiles = tiles(0) * tiles(1);
  std::mutex mutex;
  std::size_t done = 0;
  using Touching = std::pair<std::size_t, Vec3>;
  std::vector<Touching> all;
  const auto fill = [&](std::size_t first_tile, std::size_t last_tile) {
    std::vector<Touching> own;
    for (std::size_t t = first_tile; t < last_tile; ++t) {
      const int i0 = tile * static_cast<int>(t / tiles(1)), j0 = tile * static_cast<int>(t % tiles(1));
      const int ni = std::min(tile, grid.n[0] - i0), nj = std::min(tile, grid.n[1] - j0);
      SignedDistance s;
      Vec3 before = Vec3::Zero();
      for (int k = 0; k < grid.n[2]; ++k)
        for (int step = 0; step < ni * nj; ++step) {
          const int at = k % 2 ? ni * nj - 1 - step : step, i = at / nj,
                    j = i % 2 ? nj - 1 - at % nj : at % nj;
          const Vec3 p = grid.point(i0 + i, j0 + j, k);
          s = surface.beside(p, before, s);
          before = p;
          const std::size_t number = grid.number({i0 + i, j0 + j, k});
          samples.distance[number] = s.distance;
          samples.closest[number] = s.point;
          if (std::abs(s.distance) < touches * grid.h) own.emplace_back(number, s.normal);
        }
    }
    const std::lock_guard lock(mutex);
    all.insert(all.end(), own.begin(), own.end());
    done += last_tile - first_tile;
    progress.at(static_cast<double>(done) / static_cast<double>(all_tiles));
  };
  parallel_for(all_tiles, 1, threads, fill);
  std::sort(all.begin(), all.end(), [](const Touching& x, const Touching& y) { return x.first < y.first; });
  for (const auto& [number, normal] : all) {
    samples.touching.push_back(number);
    samples.touching_normal.push_back(normal);
  }
  return samples;
}

InterpolationError estimate_error(const SignedDistanceField& surface, const LatticeSamples& samples,
                                  int points, std::uint64_t seed) {
  const Box box = samples.grid.box();
  InterpolationError error;
  double sum = 0;
  for (int i = 0; i < points; ++i) {
    const double x = uniform(seed), y = uniform(seed), z = uniform(seed);
    const Vec3 p = box.min + box.size().cwiseProduct(Vec3(x, y, z));
    const double trilinear = Corners(samples.grid, samples.grid.n, p).mix(samples.distance);
    const double e = std::abs(trilinear - surface.at(p).distance);
    error.max = std::max(error.max, e);
    sum += e * e;
  }
  error.rms = points > 0 ? std::sqrt(sum / points) : 0;
  return error;
}

Lattice::Lattice(const LatticeSamples& samples, Storage storage)
    : grid_(samples.grid), stored_(spread(grid_.n)), sign_(samples.sign) {
  const auto& n = grid_.n;
  const std::size_t places = Grid::number(stored_, {n[0], 0, 0});
  if (places >= std::size_t{1} << 31)
    throw Error(ErrorKind::resource,
                "a lattice of {} points is more than there are numbers for (2^31); use a larger spacing",
                grid_.size());
  distance_.resize(places);
  closest_.resize(places);
  jets_.resize(places);
  if (storage == Storage::float16) quads_.resize(places);
  for (int i = 0; i < n[0]; ++i)
    for (int j = 0; j < n[1]; ++j)
      for (int k = 0; k < n[2]; ++k) {
        const std::size_t at = grid_.number({i, j, k}), to = Grid::number(stored_, {i, j, k});
        distance_[to] = static_cast<float>(samples.distance[at]);
        closest_[to] = samples.closest[at].cast<float>();
        jets_[to] = {distance_[to], gradient_at(samples, {i, j, k}).cast<float>()};
        for (unsigned m = 0; m < 4 && storage == Storage::float16; ++m) {
          const double d =
              samples.distance[grid_.number({std::min(i + static_cast<int>(m >> 1), n[0] - 1),
                                             std::min(j + static_cast<int>(m & 1), n[1] - 1), k})];
          quads_[to] |= std::uint64_t{to_half(static_cast<float>(d / grid_.h))} << 16 * m;
        }
      }
}

BatchView Lattice::view() const noexcept {
  BatchView view{distance_.data(),
                 quads_.empty() ? nullptr : quads_.data(),
                 &jets_.data()->distance,
                 grid_.n,
                 stored_,
                 {},
                 static_cast<float>(grid_.h)};
  for (std::size_t a = 0; a < 3; ++a) view.origin[a] = static_cast<float>(grid_.origin[static_cast<int>(a)]);
  return view;
}

void Lattice::sample(std::span<const Vec3f> points, const Batch& out, Interpolation how,
                     Simd simd) const noexcept {
  const BatchView grid = view();
  constexpr std::size_t part =
      2048;  // the caches still know them when they are looked through for those outside
  std::array<float, part> own, outside;
  for (std::size_t begin = 0; begin < points.size(); begin += part) {
    const std::size_t n = std::min(part, points.size() - begin);
    float* const distances = out.distance.empty() ? own.data() : out.distance.data() + begin;
    Vec3f* const gradients = out.gradient.empty() ? nullptr : out.gradient.data() + begin;
    interpolate_batch(grid, how, simd, points[begin].data(), n,
                      {distances, gradients ? gradients->data() : nullptr, outside.data()});
    bool all_inside = true;
    for (std::size_t i = 0; i < n; ++i) all_inside &= outside[i] == 0;
    for (std::size_t i = 0; i < n && !all_inside; ++i) {
      if (outside[i] == 0) continue;
      const Vec3 g = gradients ? Vec3(gradients[i].cast<double>()) : Vec3(Vec3::Zero());
      const LatticeSample s =
          beyond(grid_, points[begin + i].cast<double>(), {static_cast<double>(distances[i]), g});
      distances[i] = static_cast<float>(s.distance);
      if (gradients) gradients[i] = s.gradient.cast<float>();
    }
    if (!out.closest.empty())
      for (std::size_t i = begin; i < begin + n; ++i)
        out.closest[i] =
            closest(points[i].cast<double>()).value_or(Vec3::Constant(std::nan(""))).cast<float>();
  }
}

LatticeSample Lattice::hermite(const Vec3& p) const noexcept {
  float distance = 0, outside = 0;
  Vec3f gradient = Vec3f::Zero();
  interpolate_batch(view(), Interpolation::hermite, best_simd(), Vec3f(p.cast<float>()).data(), 1,
                    {&distance, gradient.data(), &outside});
  const LatticeSample s{static_cast<double>(distance), gradient.cast<double>()};
  return outside == 0 ? s : beyond(grid_, p, s);
}

double Lattice::distance(const Vec3& p) const noexcept {
  const Box box = grid_.box();
  const double d = Corners(grid_, stored_, p).mix(distance_);
  return box.contains(p) ? d : beyond(grid_, d, (p - p.cwiseMax(box.min).cwiseMin(box.max)).norm());
}

namespace {

// Four numbers along z.
using Four [[gnu::vector_size(32)]] = double;

// Splines from their 27 grid points each, where these and a fourth along z are all in the grid; elsewhere the
// distance is left no number. One loop with nothing to call, so that points overlap: what one takes is mostly
// waiting.
PALPATE_CLONES void splines_inside(const float* values, const std::int32_t* n, const std::int32_t* stored,
                                   const double* origin, double h, std::span<const Vec3> points,
                                   LatticeSample* out) noexcept {
  using Floats [[gnu::vector_size(16)]] = float;
  const double per_h = 1 / h;
  const auto row = static_cast<std::size_t>(stored[2]), sheet = row * static_cast<std::size_t>(stored[1]);
  for (std::size_t i = 0; i < points.size(); ++i) {
    double w[3][3], dw[3][3];
    std::size_t middle[3];
    bool inside = true;
    for (int a = 0; a < 3; ++a) {
      const double x = (points[i].data()[a] - origin[a]) * per_h;
      inside = inside && x >= 0.5 && x < n[a] - (a == 2 ? 2.5 : 1.5);
      const auto m = static_cast<std::int32_t>(inside ? x + 0.5 : 1.0);
      middle[a] = static_cast<std::size_t>(m);
      const double t = x - m;
      w[a][0] = 0.5 * (0.5 - t) * (0.5 - t), w[a][1] = 0.75 - t * t, w[a][2] = 0.5 * (0.5 + t) * (0.5 + t);
      dw[a][0] = t - 0.5, dw[a][1] = -2 * t, dw[a][2] = t + 0.5;
    }
    if (!inside) {
      out[i].distance = std::numeric_limits<double>::quiet_NaN();
      continue;
    }
    const float* corner = values + (middle[0] - 1) * sheet + (middle[1] - 1) * row + middle[2] - 1;
    Four d = {}, gx = {}, gy = {};
    for (std::size_t j = 0; j < 3; ++j) {
      Four along = {}, slope = {};
      for (std::size_t k = 0; k < 3; ++k) {
        Floats floats;
        std::memcpy(&floats, corner + j * sheet + k * row, sizeof floats);
        const Four v = __builtin_convertvector(floats, Four);
        along += w[1][k] * v, slope += dw[1][k] * v;
      }
      d += w[0][j] * along, gx += dw[0][j] * along, gy += w[0][j] * slope;
    }
    const double *const z = w[2], *const dz = dw[2];
    out[i].distance = (d[0] * z[0] + d[1] * z[1]) + d[2] * z[2];
    double* const g = out[i].gradient.data();
    g[0] = ((gx[0] * z[0] + gx[1] * z[1]) + gx[2] * z[2]) * per_h;
    g[1] = ((gy[0] * z[0] + gy[1] * z[1]) + gy[2] * z[2]) * per_h;
    g[2] = ((d[0] * dz[0] + d[1] * dz[1]) + d[2] * dz[2]) * per_h;
  }
}

}  // namespace

void Lattice::smooth(std::span<const Vec3> points, std::span<LatticeSample> out) const noexcept {
  splines_inside(distance_.data(), grid_.n.data(), stored_.data(), grid_.origin.data(), grid_.h, points,
                 out.data());
  for (std::size_t i = 0; i < points.size(); ++i)
    if (std::isnan(out[i].distance)) out[i] = smooth_anywhere(points[i]);
}

LatticeSample Lattice::smooth(const Vec3& p) const noexcept {
  LatticeSample s;
  smooth(std::span(&p, 1), std::span(&s, 1));
  return s;
}

LatticeSample Lattice::smooth_anywhere(const Vec3& p) const noexcept {
  const Spline spline(grid_, p);
  std::array<double, 27> values;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const std::size_t row = Grid::number(stored_, {spline.at[0][i], spline.at[1][j], 0});
      for (std::size_t k = 0; k < 3; ++k)
        values[9 * i + 3 * j + k] =
            static_cast<double>(distance_[row + static_cast<std::size_t>(spline.at[2][k])]);
    }
  const LatticeSample s = spline(values, grid_.h);
  return grid_.box().contains(p) ? s : beyond(grid_, p, s);
}

double Lattice::lower_bound(const Vec3& p) const noexcept {
  const Box box = grid_.box();
  const Vec3 q = p.cwiseMax(box.min).cwiseMin(box.max);
  const Vec3 x = (q - grid_.origin) / grid_.h + Vec3::Constant(0.5);
  const std::array<std::int32_t, 3> at{static_cast<std::int32_t>(x[0]), static_cast<std::int32_t>(x[1]),
                                       static_cast<std::int32_t>(x[2])};
  if (!(x.sum() < 1e9)) return -std::numeric_limits<double>::infinity();  // p is no number
  const double way = (q - grid_.point(at[0], at[1], at[2])).norm();
  // The spline's weights lie about p with a variance of h^2 / 4 along each axis, and the distances differ by
  // no more than the ways.
  const double d =
      static_cast<double>(distance_[Grid::number(stored_, at)]) - way - std::sqrt(0.75) * grid_.h;
  const double s = (p - q).norm();
  return s > 0 ? beyond(grid_, d, s) : d;
}

LatticeSample Lattice::sample(const Vec3& p) const noexcept {
  const Box box = grid_.box();
  const Corners corners(grid_, stored_, p);
  const double d = corners.mix(distance_);
  Vec3 g = Vec3::Zero();
  for (std::size_t m = 0; m < 8; ++m) g += corners.weight[m] * jets_[corners.at[m]].gradient.cast<double>();
  double length = g.norm();
  // On the medial axis opposite gradients cancel: the heaviest corner's will do, and is never zero.
  if (length < 1e-3) {
    const auto heaviest = std::max_element(corners.weight.begin(), corners.weight.end());
    g = jets_[corners.at[static_cast<std::size_t>(heaviest - corners.weight.begin())]]
            .gradient.cast<double>();
    length = g.norm();
  }
  g /= length;
  return box.contains(p) ? LatticeSample{d, g} : beyond(grid_, p, {d, g});
}

void Lattice::distance(std::span<const Vec3> points, std::span<double> out) const noexcept {
  for (std::size_t i = 0; i < points.size(); ++i) out[i] = distance(points[i]);
}

void Lattice::sample(std::span<const Vec3> points, std::span<LatticeSample> out) const noexcept {
  for (std::size_t i = 0; i < points.size(); ++i) out[i] = sample(points[i]);
}

std::optional<Vec3> Lattice::closest(const Vec3& p) const noexcept {
  if (!grid_.box().contains(p)) return {};
  const Corners corners(grid_, stored_, p);
  const auto farthest2 = static_cast<float>(4 * grid_.h * grid_.h);
  for (std::size_t a = 0; a < 8; ++a)
    for (std::size_t b = 0; b < a; ++b)
      if ((closest_[corners.at[a]] - closest_[corners.at[b]]).squaredNorm() > farthest2) return {};
  const Vec3 c = corners.mix(closest_);
  if (!(std::abs(distance(c)) < 0.1 * grid_.h)) return {};
  return c;
}

}  // namespace palpate
