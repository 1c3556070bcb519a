#include "palpate/contact/path.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

// Shares of finest(shape).
constexpr double touching = 1e-3;  // as near as this is on the surface
constexpr double stride = 0.5;     // least step along a way: shorter than the thinnest part
constexpr double lift = 0.25;      // of a proxy off the surface while it moves along it
constexpr int most_strides = 400, most_slides = 30;

struct Meeting {
  Vec3 at = Vec3::Zero();
  bool met = false;
};

// Where the way from a, outside, to b first meets the solid: strides as long as the distance says that they
// are free (Hart, "Sphere tracing", 1996), then regula falsi.
Meeting follow(const Shape& shape, double fine, const Vec3& a, const Vec3& b) noexcept {
  const double length = (b - a).norm();
  if (!(length > 0)) return {a, false};
  const Vec3 along = (b - a) / length;
  const Gap start = gap(shape, a);
  double out = 0, phi_out = std::max(start.distance, 0.0), t = std::min(start.distance / lipschitz, length);
  if (start.distance <= touching * fine) {
    if (along.dot(start.normal) <= 0) return {a, true};
    t = 0;
  }
  for (int k = 0; k < most_strides && out < length; ++k) {
    t = std::min(std::max(t, out + stride * fine), length);
    const double phi = distance(shape, a + t * along);
    if (phi < 0) {
      double in = t, phi_in = phi;
      for (int i = 0; i < 12 && phi_out > touching * fine; ++i) {
        const double middle = std::clamp(out + (in - out) * phi_out / (phi_out - phi_in),
                                         out + 0.1 * (in - out), in - 0.1 * (in - out));
        const double phi_middle = distance(shape, a + middle * along);
        (phi_middle < 0 ? in : out) = middle;
        (phi_middle < 0 ? phi_in : phi_out) = phi_middle;
      }
      return {a + out * along, true};
    }
    out = t, phi_out = phi, t += phi / lipschitz;
  }
  return {b, out < length};
}

Vec3 to_surface(const Shape& shape, double fine, const Vec3& p, Vec3& normal) noexcept {
  Vec3 q = p;
  for (int k = 0; k < 3; ++k) {
    const Gap g = gap(shape, q);
    if (k > 0 && std::abs(g.distance) <= touching * fine) break;  // on an edge rounding decides the normal
    normal = g.normal;
    q -= g.distance / g.slope * g.normal;
  }
  return q;
}

// The proxy's place after it has followed p as far as the surface lets it; false: all the way, p is free.
bool follow_over_surface(const Shape& shape, double fine, const Vec3& p, Vec3& q, Vec3& normal) noexcept {
  const auto lifted = [&] {
    const Vec3 up = q + lift * fine * normal;
    return distance(shape, up) > 0.5 * lift * fine ? up : q;
  };
  for (int k = 0; k < most_slides; ++k) {
    const Vec3 way = p - q;
    const double height = way.dot(normal);
    if (height >= 0) {
      const Meeting m = follow(shape, fine, lifted(), p);
      if (!m.met) return false;
      if ((m.at - q).norm() <= touching * fine) return true;
      q = to_surface(shape, fine, m.at, normal);
      continue;
    }
    const Vec3 sideways = way - height * normal;
    if (sideways.norm() <= 1e-3 * way.norm() + touching * fine) return true;
    const Vec3 start = lifted(), before = q;
    q = to_surface(shape, fine, follow(shape, fine, start, start + sideways).at, normal);
    if ((q - before).norm() <= touching * fine) return true;
  }
  return true;
}

}  // namespace

Path path_from(const PlacedShape& shape, const Vec3& from) noexcept {
  const Gap g = gap(*shape.shape, from);
  return {from, g.normal, g.distance, g.distance > -hardly_inside * shape.finest};
}

Gap gap_by_path(const PlacedShape& placed, const Path& path, const Vec3& p, Path* gone) noexcept {
  const Vec3 own = placed.own(p);
  return gap_by_path(placed, path, own, gap(*placed.shape, own), gone);
}

Gap gap_by_path(const PlacedShape& placed, const Path& path, const Vec3& own, Gap g, Path* gone) noexcept {
  const Shape& shape = *placed.shape;
  const auto plain = [&] {
    const double inside = std::min(g.distance, 0.0);
    if (gone) *gone = {own - inside / g.slope * g.normal, g.normal, g.distance - inside, true};
    g.normal = placed.turn * g.normal;
    return g;
  };
  if (!path.known) {
    gone = nullptr;  // one that began inside has no side
    return plain();
  }
  const double length = (own - path.from).norm(), fine = placed.finest;
  if (length < fine && (g.distance >= 0 || g.normal.dot(path.normal) > 0.5)) return plain();
  if (path.distance + g.distance > lipschitz * length) return plain();
  const Meeting m = follow(shape, fine, path.from, own);
  if (!m.met) return plain();
  Vec3 normal, q = to_surface(shape, fine, m.at, normal);
  if (!follow_over_surface(shape, fine, own, q, normal)) return plain();
  const double depth = (own - q).norm();
  if (g.normal.dot(normal) > 0.5 &&
      (own - g.distance / g.slope * g.normal - q).norm() <= 0.1 * depth + touching * fine)
    return plain();
  if (gone) *gone = {q, normal, 0, true};
  return {-depth, placed.turn * normal, 1};
}

bool passes(const Shape& shape, const Vec3& a, const Vec3& b, double clearance) noexcept {
  const double length = (b - a).norm();
  const double least = std::max(0.1 * clearance, length / most_strides);
  for (double t = 0;;) {
    const double phi = distance(shape, length > 0 ? Vec3(a + t / length * (b - a)) : a);
    if (phi <= clearance + least) return true;
    if (t >= length) return false;
    t = std::min(t + (phi - clearance) / lipschitz, length);
  }
}

}  // namespace palpate
