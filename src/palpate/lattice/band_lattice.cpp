#include "palpate/lattice/band_lattice.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "palpate/base/parallel_for.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/lattice/cell.hpp"

namespace palpate {

namespace {

using Point = std::array<std::int32_t, 3>;

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

std::size_t inner(const Point& p) {
  return at(((p[0] % brick) * brick + p[1] % brick) * brick + p[2] % brick);
}
Vec3 center_of(const Grid& grid, const Point& b) {
  const double half = 0.5 * (brick - 1);
  return grid.origin + grid.h * Vec3(brick * b[0] + half, brick * b[1] + half, brick * b[2] + half);
}
Point place(const std::array<std::int32_t, 3>& bricks, std::size_t number) {
  const auto z = at(bricks[2]), y = at(bricks[1]);
  return {static_cast<std::int32_t>(number / z / y), static_cast<std::int32_t>(number / z % y),
          static_cast<std::int32_t>(number % z)};
}
std::size_t count(const std::array<std::int32_t, 3>& bricks) {
  return at(bricks[0]) * at(bricks[1]) * at(bricks[2]);
}

void require_memory(double bytes, const Grid& grid, double band) {
  const auto available = static_cast<double>(available_bytes());
  if (bytes > available)
    throw Error(
        ErrorKind::resource,
        "a band of {:.3g} m in a lattice of {} x {} x {} points needs {:.1f} GB of memory, {:.1f} are "
        "available; use a narrower band or a larger spacing",
        band, grid.n[0], grid.n[1], grid.n[2], 1e-9 * bytes, 1e-9 * available);
}

// The samples of one brick, walked to and fro so that each point's neighbour was asked just before.
void fill_brick(const SignedDistanceField& surface, const Point& b, std::size_t slot, BandSamples& out) {
  const Grid& grid = out.grid;
  SignedDistance s;
  Vec3 before = Vec3::Zero();
  for (int i = 0; i < brick; ++i)
    for (int u = 0; u < brick; ++u)
      for (int v = 0; v < brick; ++v) {
        const int j = i % 2 ? brick - 1 - u : u, k = (i + u) % 2 ? brick - 1 - v : v;
        const Vec3 p = grid.point(brick * b[0] + i, brick * b[1] + j, brick * b[2] + k);
        s = surface.beside(p, before, s);
        before = p;
        const std::size_t number = slot * brick_points + inner({i, j, k});
        out.distance[number] = s.distance;
        out.closest[number] = s.point;
        const Vec3 away = p - s.point;
        // On the surface itself away says nothing.
        out.gradient[number] = std::abs(s.distance) < 1e-6 * grid.h
                                   ? Vec3(surface.at(p).normal)
                                   : Vec3(away / std::copysign(away.norm(), s.distance));
      }
}

// Of the chosen bricks keeps those with a point nearer than `wanted`, and numbers them.
void drop_unwanted(const std::vector<std::size_t>& chosen, double wanted, BandSamples& out) {
  std::size_t kept = 0;
  const auto move = [&](auto& values, std::size_t from, std::size_t to) {
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(from), brick_points,
                values.begin() + static_cast<std::ptrdiff_t>(to));
  };
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const std::size_t from = i * brick_points, to = kept * brick_points;
    const auto first = out.distance.begin() + static_cast<std::ptrdiff_t>(from);
    if (std::none_of(first, first + brick_points, [&](double d) { return std::abs(d) <= wanted; })) continue;
    if (from != to) move(out.distance, from, to), move(out.closest, from, to), move(out.gradient, from, to);
    out.slot[chosen[i]] = static_cast<std::int32_t>(kept++);
  }
  out.distance.resize(kept * brick_points);
  out.closest.resize(kept * brick_points), out.gradient.resize(kept * brick_points);
}

}  // namespace

BandSamples sample_band(const SignedDistanceField& surface, const Grid& grid, double band, int threads,
                        const Progress& progress) {
  if (!(band >= grid.h) || !std::isfinite(band))
    throw Error(ErrorKind::usage, "a band of {:.3g} m is narrower than the lattice's spacing of {:.3g} m",
                band, grid.h);
  BandSamples out;
  out.grid = grid, out.band = band, out.sign = surface.method();
  for (std::size_t a = 0; a < 3; ++a) out.bricks[a] = (grid.n[a] + brick - 1) / brick;
  const std::size_t all = count(out.bricks), line = at(out.bricks[2]);
  require_memory(12.0 * static_cast<double>(all), grid, band);
  out.center.resize(all);
  out.slot.assign(all, -1);
  std::mutex mutex;
  double done = 0;
  const auto report = [&](double share) {
    const std::lock_guard lock(mutex);
    progress.at(done += share);
  };
  const double first_share = 1.0 / (1 + brick_points / 20.0);  // about one brick in twenty gets samples
  parallel_for(all / line, 1, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      SignedDistance s;
      Vec3 before = Vec3::Zero();
      for (std::size_t b = row * line; b < (row + 1) * line; ++b) {
        const Vec3 p = center_of(grid, place(out.bricks, b));
        s = surface.beside(p, before, s);
        before = p;
        out.center[b] = s.distance;
      }
    }
    report(first_share * static_cast<double>((end - begin) * line) / static_cast<double>(all));
  });
  // What smooth() asks of a point in the band lies up to 1.5 sqrt(3) h from it: bricks with such points are
  // wanted. None is farther than 3.5 sqrt(3) h from its brick's centre.
  const double wanted = band + 1.5 * std::sqrt(3.0) * grid.h;
  const double reach = wanted + 0.5 * (brick - 1) * std::sqrt(3.0) * grid.h;
  std::vector<std::size_t> chosen;
  for (std::size_t b = 0; b < all; ++b)
    if (std::abs(out.center[b]) <= reach) chosen.push_back(b);
  const std::size_t points = chosen.size() * brick_points;
  require_memory(static_cast<double>(points) * (sizeof(double) + 2 * sizeof(Vec3)), grid, band);
  out.distance.resize(points), out.closest.resize(points), out.gradient.resize(points);
  parallel_for(chosen.size(), 4, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) fill_brick(surface, place(out.bricks, chosen[i]), i, out);
    report((1 - first_share) * static_cast<double>(end - begin) / static_cast<double>(chosen.size()));
  });
  drop_unwanted(chosen, wanted, out);
  return out;
}

InterpolationError estimate_error(const SignedDistanceField& surface, const BandSamples& samples, int points,
                                  std::uint64_t seed) {
  const BandLattice lattice(samples);
  std::vector<std::size_t> chosen;
  for (std::size_t b = 0; b < samples.slot.size(); ++b)
    if (samples.slot[b] >= 0) chosen.push_back(b);
  InterpolationError error;
  double sum = 0;
  int found = 0;
  for (int i = 0; i < points && !chosen.empty(); ++i) {
    const auto which = static_cast<std::size_t>(uniform(seed) * static_cast<double>(chosen.size()));
    const double x = uniform(seed) - 0.5, y = uniform(seed) - 0.5, z = uniform(seed) - 0.5;
    const Vec3 p = center_of(samples.grid, place(samples.bricks, chosen[which])) +
                   brick * samples.grid.h * Vec3(x, y, z);
    if (!samples.grid.box().contains(p)) continue;
    const double exact = surface.at(p).distance;
    if (std::abs(exact) > samples.band) continue;
    const double e = std::abs(lattice.distance(p) - exact);
    error.max = std::max(error.max, e);
    sum += e * e;
    ++found;
  }
  error.rms = found > 0 ? std::sqrt(sum / found) : 0;
  return error;
}

BandLattice::BandLattice(const BandSamples& samples)
    : grid_(samples.grid),
      band_(samples.band),
      bricks_(samples.bricks),
      center_(samples.center),
      slot_(samples.slot),
      sign_(samples.sign) {
  const std::size_t n = samples.distance.size();
  distance_.reserve(n), closest_.reserve(n), gradient_.reserve(n);
  for (std::size_t i = 0; i < n; ++i) {
    distance_.push_back(static_cast<float>(samples.distance[i]));
    closest_.push_back(samples.closest[i].cast<float>());
    gradient_.push_back(samples.gradient[i].cast<float>());
  }
}

std::size_t BandLattice::bytes() const {
  return center_.size() * (sizeof(double) + sizeof(std::int32_t)) +
         distance_.size() * (sizeof(float) + 2 * sizeof(Vec3f));
}

std::size_t BandLattice::brick_of(const Point& p) const noexcept {
  return (at(p[0] / brick) * at(bricks_[1]) + at(p[1] / brick)) * at(bricks_[2]) + at(p[2] / brick);
}
std::int64_t BandLattice::number(const Point& p) const noexcept {
  const std::int32_t slot = slot_[brick_of(p)];
  return slot < 0 ? -1 : slot * std::int64_t{brick_points} + static_cast<std::int64_t>(inner(p));
}

bool BandLattice::corners(const Point& first, std::array<std::size_t, 8>& at_corner) const noexcept {
  for (std::size_t m = 0; m < 8; ++m) {
    const std::int64_t i = number({first[0] + static_cast<std::int32_t>(m >> 2),
                                   first[1] + static_cast<std::int32_t>(m >> 1 & 1),
                                   first[2] + static_cast<std::int32_t>(m & 1)});
    if (i < 0) return false;
    at_corner[m] = at(i);
  }
  return true;
}

// Of a point with a grid point without samples at most 1.5 sqrt(3) h away: all points of that one's brick are
// farther from the surface than the band and this way, so none lies between them, p and the brick's centre.
LatticeSample BandLattice::far(const Vec3& p, const Point& near) const noexcept {
  const Point b{near[0] / brick, near[1] / brick, near[2] / brick};
  const double d = center_[brick_of(near)], way = (p - center_of(grid_, b)).norm();
  LatticeSample s{std::copysign(std::max(band_, std::abs(d) - way) * (1 - 1e-12), d), Vec3::Zero()};
  for (std::size_t a = 0; a < 3; ++a) {
    Point low = near, high = near;
    low[a] = std::max(0, near[a] - brick), high[a] = std::min((bricks_[a] - 1) * brick, near[a] + brick);
    s.gradient[static_cast<int>(a)] =
        (center_[brick_of(high)] - center_[brick_of(low)]) / std::max(1, high[a] / brick - low[a] / brick);
  }
  const double length = s.gradient.norm();
  s.gradient = length > 0 ? Vec3(s.gradient / length) : Vec3::UnitZ();
  return s;
}

LatticeSample BandLattice::sample(const Vec3& p) const noexcept {
  const Box box = grid_.box();
  const Cell cell = cell_at(grid_, p);
  LatticeSample s{0, Vec3::Zero()};
  std::array<std::size_t, 8> corner;
  if (corners(cell.at, corner)) {
    const std::array<double, 8> weight = trilinear(cell.t);
    std::size_t heaviest = 0;
    for (std::size_t m = 0; m < 8; ++m) {
      s.distance += weight[m] * static_cast<double>(distance_[corner[m]]);
      s.gradient += weight[m] * gradient_[corner[m]].cast<double>();
      if (weight[m] > weight[heaviest]) heaviest = m;
    }
    // On the medial axis opposite gradients cancel: the heaviest corner's will do, and is never zero.
    if (s.gradient.norm() < 1e-3) s.gradient = gradient_[corner[heaviest]].cast<double>();
    s.gradient.normalize();
  } else {
    Point without = cell.at;
    for (int m = 0; m < 8; ++m) {
      const Point q{cell.at[0] + (m >> 2), cell.at[1] + (m >> 1 & 1), cell.at[2] + (m & 1)};
      if (number(q) < 0) without = q;
    }
    s = far(p.cwiseMax(box.min).cwiseMin(box.max), without);
  }
  return box.contains(p) ? s : beyond(grid_, p, s);
}

double BandLattice::distance(const Vec3& p) const noexcept { return sample(p).distance; }

LatticeSample BandLattice::smooth(const Vec3& p) const noexcept {
  const Spline spline(grid_, p);
  const Box box = grid_.box();
  std::array<double, 27> values;
  for (std::size_t m = 0; m < 27; ++m) {
    const Point q{spline.at[0][m / 9], spline.at[1][m / 3 % 3], spline.at[2][m % 3]};
    const std::int64_t i = number(q);
    if (i < 0) {
      const LatticeSample s = far(p.cwiseMax(box.min).cwiseMin(box.max), q);
      return box.contains(p) ? s : beyond(grid_, p, s);
    }
    values[m] = static_cast<double>(distance_[at(i)]);
  }
  const LatticeSample s = spline(values, grid_.h);
  return box.contains(p) ? s : beyond(grid_, p, s);
}

std::optional<Vec3> BandLattice::closest(const Vec3& p) const noexcept {
  const Cell cell = cell_at(grid_, p);
  std::array<std::size_t, 8> corner;
  if (!grid_.box().contains(p) || !corners(cell.at, corner)) return {};
  const auto farthest2 = static_cast<float>(4 * grid_.h * grid_.h);
  for (std::size_t a = 0; a < 8; ++a)
    for (std::size_t b = 0; b < a; ++b)
      if ((closest_[corner[a]] - closest_[corner[b]]).squaredNorm() > farthest2) return {};
  const std::array<double, 8> weight = trilinear(cell.t);
  Vec3 c = Vec3::Zero();
  for (std::size_t m = 0; m < 8; ++m) c += weight[m] * closest_[corner[m]].cast<double>();
  if (!(std::abs(distance(c)) < 0.1 * grid_.h)) return {};
  return c;
}

void BandLattice::distance(std::span<const Vec3> points, std::span<double> out) const noexcept {
  for (std::size_t i = 0; i < points.size(); ++i) out[i] = distance(points[i]);
}

void BandLattice::sample(std::span<const Vec3> points, std::span<LatticeSample> out) const noexcept {
  for (std::size_t i = 0; i < points.size(); ++i) out[i] = sample(points[i]);
}

}  // namespace palpate
