#include "palpate/contact/shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/geometry/shapes.hpp"

namespace palpate {

namespace {

Gap from_centre(const Vec3& r, double radius) {
  const double length = r.norm();
  return {length - radius, length > 0 ? Vec3(r / length) : Vec3::UnitZ()};
}

Gap cuboid_gap(const Vec3& half, const Vec3& p) {
  const Vec3 q = p.cwiseAbs() - half;
  const Vec3 sign = p.unaryExpr([](double x) { return x < 0 ? -1.0 : 1.0; });
  const Vec3 out = q.cwiseMax(0.0);
  const double outside = out.norm();
  if (outside > 0) return {outside, out.cwiseProduct(sign) / outside};
  int axis = 0;
  const double inside = q.maxCoeff(&axis);
  return {inside, sign[axis] * Vec3::Unit(axis)};
}

Gap gap_from(const LatticeSample& s) {
  const double slope = s.gradient.norm();
  return {s.distance, slope > 1e-9 ? Vec3(s.gradient / slope) : Vec3::UnitZ(), std::clamp(slope, 0.1, 2.0)};
}

struct GapAt {
  const Vec3& p;
  Gap operator()(const Sphere& s) const { return from_centre(p, s.radius); }
  Gap operator()(const Capsule& c) const {
    return from_centre(p - Vec3(0, 0, std::clamp(p.z(), -c.half_length, c.half_length)), c.radius);
  }
  Gap operator()(const Cuboid& c) const { return cuboid_gap(c.half, p); }
  Gap operator()(const HalfSpace&) const { return {p.z(), Vec3::UnitZ()}; }
  template <class AnyLattice>
  Gap operator()(const std::shared_ptr<const AnyLattice>& lattice) const {
    return gap_from(lattice->smooth(p));
  }
};

struct BoxOf {
  Box operator()(const Sphere& s) const { return {Vec3::Constant(-s.radius), Vec3::Constant(s.radius)}; }
  Box operator()(const Capsule& c) const {
    const Vec3 half(c.radius, c.radius, c.radius + c.half_length);
    return {-half, half};
  }
  Box operator()(const Cuboid& c) const { return {-c.half, c.half}; }
  Box operator()(const HalfSpace&) const {
    const double inf = std::numeric_limits<double>::infinity();
    return {Vec3::Constant(-inf), Vec3(inf, inf, 0)};
  }
  template <class AnyLattice>
  Box operator()(const std::shared_ptr<const AnyLattice>& lattice) const {
    return lattice->grid().box();
  }
};

struct FinestOf {
  double operator()(const Sphere& s) const { return s.radius; }
  double operator()(const Capsule& c) const { return c.radius; }
  double operator()(const Cuboid& c) const { return c.half.minCoeff(); }
  double operator()(const HalfSpace&) const { return std::numeric_limits<double>::infinity(); }
  template <class AnyLattice>
  double operator()(const std::shared_ptr<const AnyLattice>& lattice) const {
    return lattice->grid().h;
  }
};

// A capsule is a sphere whose halves are pulled apart.
TriangleMesh capsule_surface(const Capsule& c) {
  TriangleMesh mesh = make_sphere(Vec3::Zero(), c.radius, 24, 32);
  for (Vec3& v : mesh.vertices) v.z() += v.z() < -1e-12 ? -c.half_length : c.half_length;
  return mesh;
}

TriangleMesh square(double side) {
  const double a = side / 2;
  return {{Vec3(-a, -a, 0), Vec3(a, -a, 0), Vec3(a, a, 0), Vec3(-a, a, 0)}, {{0, 1, 2}, {0, 2, 3}}};
}

}  // namespace

bool is_empty(const Shape& shape) noexcept {
  const auto* whole = std::get_if<std::shared_ptr<const Lattice>>(&shape);
  const auto* band = std::get_if<std::shared_ptr<const BandLattice>>(&shape);
  return (whole && !*whole) || (band && !*band);
}

bool has_size(const Shape& shape) noexcept {
  const auto above_zero = [](double x) { return x > 0 && std::isfinite(x); };
  if (const auto* s = std::get_if<Sphere>(&shape)) return above_zero(s->radius);
  if (const auto* c = std::get_if<Capsule>(&shape))
    return above_zero(c->radius) && c->half_length >= 0 && std::isfinite(c->half_length);
  if (const auto* b = std::get_if<Cuboid>(&shape)) return b->half.allFinite() && b->half.minCoeff() > 0;
  return true;
}

double distance(const Shape& shape, const Vec3& p) noexcept { return std::visit(GapAt{p}, shape).distance; }

double distance_bound(const Shape& shape, const Vec3& p) noexcept {
  const auto* whole = std::get_if<std::shared_ptr<const Lattice>>(&shape);
  return whole ? (*whole)->lower_bound(p) : distance(shape, p);
}

Gap gap(const Shape& shape, const Vec3& p) noexcept { return std::visit(GapAt{p}, shape); }

void gaps(const Shape& shape, std::span<const Vec3> points, std::span<Gap> out) noexcept {
  const auto* whole = std::get_if<std::shared_ptr<const Lattice>>(&shape);
  std::array<LatticeSample, 32> samples;
  for (std::size_t first = 0; first < points.size(); first += samples.size()) {
    const std::size_t count = std::min(samples.size(), points.size() - first);
    if (whole) (*whole)->smooth(points.subspan(first, count), samples);
    for (std::size_t i = 0; i < count; ++i)
      out[first + i] = whole ? gap_from(samples[i]) : gap(shape, points[first + i]);
  }
}

double band(const Shape& shape) noexcept {
  const auto* lattice = std::get_if<std::shared_ptr<const BandLattice>>(&shape);
  if (!lattice) return std::numeric_limits<double>::infinity();
  // Beyond the band a lattice says no less than that but for rounding, and about its grid takes off what is
  // not sure there.
  const double band = (*lattice)->band(), off = std::sqrt(0.5) * (*lattice)->grid().h;
  return (std::sqrt(band * band + off * off) - off) * (1 - 1e-9);
}

double finest(const Shape& shape) noexcept { return std::visit(FinestOf{}, shape); }

Box bounding_box(const Shape& shape) noexcept { return std::visit(BoxOf{}, shape); }

TriangleMesh surface_of_primitive(const Shape& shape) {
  if (const auto* s = std::get_if<Sphere>(&shape)) return make_sphere(Vec3::Zero(), s->radius, 24, 32);
  if (const auto* c = std::get_if<Capsule>(&shape)) return capsule_surface(*c);
  if (const auto* b = std::get_if<Cuboid>(&shape)) return make_box({-b->half, b->half});
  if (std::holds_alternative<HalfSpace>(shape)) return square(0.2);
  return {};
}

}  // namespace palpate
