// The demo's organ: a bean bent out of the unit sphere by maps that cannot fold (each moves points along one
// direction, monotonically), its triangles evened out by flips and by moving vertices to the area-weighted
// mean of their triangles' centroids (a fixed-connectivity form of Lloyd's method). Lloyd, "Least squares
// quantization in PCM" (1982).
#include <algorithm>
#include <cmath>
#include <vector>

#include "palpate/base/error.hpp"
#include "palpate/geometry/shapes.hpp"

namespace palpate {

namespace {

int frequency_for(int vertices) {
  if (vertices < 12 || vertices > 10000000)
    throw Error(ErrorKind::usage, "{} vertices: a kidney or stone has 12 to 10000000", vertices);
  int f = 1;
  while (10 * f * f + 2 < vertices) ++f;
  return f;
}

// Bean of half length about 1; y up, hilum at +x.
Vec3 bean(const Vec3& d) {
  constexpr double power = 2.3;  // rounder poles than an ellipsoid's
  const Vec3 q =
      d / std::pow(std::pow(std::hypot(d.x(), d.z()), power) + std::pow(std::abs(d.y()), power), 1 / power);
  Vec3 p(0.5 * q.x(), q.y(), 0.42 * q.z());
  const double y = p.y();
  p.x() *= 1 + 0.07 * y, p.z() *= 1 + 0.09 * y;  // the upper pole is the fuller one
  const double hilum = std::exp(-std::pow((y + 0.05) / 0.36, 2) - std::pow(p.z() / 0.27, 2));
  p.x() -= 0.24 * hilum * 0.5 * (1 + std::tanh((p.x() - 0.15) / 0.15));  // slope below 1: cannot fold
  p.x() += 0.2 * y * y;                                                  // poles lean to the hilum
  p.z() += 0.05 * y * y + 0.03 * y;
  return p;
}

// Scales and moves the bean so that it is 0.06 x 0.12 x 0.05 m about the origin.
class Kidney {
 public:
  Kidney() {
    for (const Vec3& d : make_star_shaped(Vec3::Zero(), 60, [](const Vec3&) { return 1.0; }).vertices)
      box_.add(bean(d));
  }
  Vec3 operator()(const Vec3& d) const {
    return (bean(d) - box_.center()).cwiseQuotient(box_.size()).cwiseProduct(Vec3(0.06, 0.12, 0.05));
  }

 private:
  Box box_;
};

double cotangent(const Vec3& a, const Vec3& b, const Vec3& apex) {
  const Vec3 u = a - apex, v = b - apex;
  return u.dot(v) / u.cross(v).norm();
}

// Flips edges whose two opposite angles sum to more than 180 degrees, at most once a triangle and call.
void flip_long_edges(TriangleMesh& mesh) {
  struct Side {
    Index low, high;
    std::size_t triangle, corner;  // corner opposite the side
  };
  std::vector<Side> sides;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = mesh.triangles[t][(k + 1) % 3], b = mesh.triangles[t][(k + 2) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), t, k});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
    return std::tie(x.low, x.high, x.triangle) < std::tie(y.low, y.high, y.triangle);
  });
  std::vector<char> touched(mesh.triangles.size(), 0);
  for (std::size_t s = 0; s + 1 < sides.size(); s += 2) {
    const Side &x = sides[s], &y = sides[s + 1];
    if (touched[x.triangle] || touched[y.triangle]) continue;
    Triangle &t = mesh.triangles[x.triangle], &o = mesh.triangles[y.triangle];
    const Index p = t[x.corner], a = t[(x.corner + 1) % 3], b = t[(x.corner + 2) % 3], q = o[y.corner];
    const auto v = [&](Index i) -> const Vec3& { return mesh.vertices[static_cast<std::size_t>(i)]; };
    if (cotangent(v(a), v(b), v(p)) + cotangent(v(a), v(b), v(q)) > -1e-9) continue;
    t = {p, a, q}, o = {q, b, p};
    touched[x.triangle] = touched[y.triangle] = 1;
  }
}

// One step of moving the directions so that the triangles on the surface become even.
void spread(std::vector<Vec3>& directions, const TriangleMesh& mesh) {
  std::vector<Vec3> sum(directions.size(), Vec3::Zero());
  for (const Triangle& t : mesh.triangles) {
    Vec3 centroid = Vec3::Zero();
    for (const Index v : t) centroid += directions[static_cast<std::size_t>(v)] / 3;
    const double area = area_vector(mesh, t).norm();
    for (const Index v : t) sum[static_cast<std::size_t>(v)] += area * centroid;
  }
  for (std::size_t i = 0; i < directions.size(); ++i) directions[i] = sum[i].normalized();
}

}  // namespace

TriangleMesh make_kidney(int vertices) {
  // The turn takes the icosahedron's mirror planes off the bean's: mirrored vertices would lie on common
  // circles, where Delaunay tetrahedra are not unique.
  const Mat3 turn =
      (Eigen::AngleAxisd(0.37, Vec3::UnitX()) * Eigen::AngleAxisd(0.71, Vec3::UnitZ())).toRotationMatrix();
  const Kidney kidney;
  TriangleMesh mesh =
      make_star_shaped(Vec3::Zero(), frequency_for(std::max(vertices, 92)), [](const Vec3&) { return 1.0; });
  std::vector<Vec3> directions = mesh.vertices;
  for (Vec3& d : directions) d = turn * d;
  for (int step = 0; step <= 40; ++step) {
    if (step) spread(directions, mesh);
    for (std::size_t i = 0; i < directions.size(); ++i) mesh.vertices[i] = kidney(directions[i]);
    flip_long_edges(mesh);
  }
  return mesh;
}

TriangleMesh make_stone(int vertices) {
  return make_star_shaped(Vec3(-0.002, -0.028, 0), frequency_for(vertices), [](const Vec3& d) {
    const double lumps = std::sin(4.1 * d.x() + 0.7) * std::sin(3.7 * d.y() + 1.9) +
                         std::sin(3.3 * d.z() + 0.4) * std::sin(4.6 * d.x() - 2.8 * d.y());
    return 0.0072 * (1 + 0.11 * lumps);
  });
}

}  // namespace palpate
