#include "palpate/geometry/signed_distance.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/base/error.hpp"
#include "palpate/geometry/check.hpp"
#include "palpate/geometry/crossing.hpp"

namespace palpate {

namespace {

void require_usable(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) throw Error(ErrorKind::geometry, "the surface has no triangle");
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
    if (!(mesh.vertices[i].cwiseAbs().maxCoeff() < 1e60) || !mesh.vertices[i].allFinite())
      throw Error(ErrorKind::geometry, "vertex {} of the surface has a coordinate that is no usable number",
                  i);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (const Index v : mesh.triangles[i])
      if (v < 0 || static_cast<std::size_t>(v) >= mesh.vertices.size())
        throw Error(ErrorKind::geometry, "triangle {} of the surface uses vertex {}, of {}", i, v,
                    mesh.vertices.size());
}

// Volume of the cone over the surface from its centre of area: its sign says how an open surface faces.
double volume_about_center(const TriangleMesh& mesh) {
  Vec3 center = Vec3::Zero();
  double area = 0, sum = 0;
  const auto centroid = [&](const Triangle& t) {
    return Vec3((mesh.vertices[static_cast<std::size_t>(t[0])] +
                 mesh.vertices[static_cast<std::size_t>(t[1])] +
                 mesh.vertices[static_cast<std::size_t>(t[2])]) /
                3);
  };
  for (const Triangle& t : mesh.triangles) {
    const double a = area_vector(mesh, t).norm();
    area += a;
    center += a * centroid(t);
  }
  if (area > 0) center /= area;
  for (const Triangle& t : mesh.triangles) sum += area_vector(mesh, t).dot(centroid(t) - center);
  return sum / 3;
}

// Height over longest edge of the triangle.
double flatness(const TriangleMesh& mesh, const Triangle& t) {
  double longest2 = 0;
  for (std::size_t i = 0; i < 3; ++i)
    longest2 = std::max(longest2, (mesh.vertices[static_cast<std::size_t>(t[(i + 1) % 3])] -
                                   mesh.vertices[static_cast<std::size_t>(t[i])])
                                      .squaredNorm());
  return longest2 > 0 ? 2 * area_vector(mesh, t).norm() / longest2 : 0;
}

constexpr std::size_t most_samples = 4096;

// The winding number just outside the surface (by its own normals), at a few thousand triangles spread over
// all parts: for each part the mean of the rounded values, and whether all are 0.
struct Outside {
  std::vector<double> mean;
  bool all_zero = true;
};
Outside sample_outside(const TriangleMesh& mesh, const std::vector<Index>& part, std::size_t parts) {
  const WindingNumber winding(mesh);
  std::vector<std::size_t> size(parts, 0), seen(parts, 0), taken(parts, 0);
  for (const Index c : part) ++size[static_cast<std::size_t>(c)];
  const std::size_t share = std::max<std::size_t>(most_samples / parts, 4);
  Outside result;
  result.mean.assign(parts, 0);
  for (std::size_t i = 0; i < part.size(); ++i) {
    const auto c = static_cast<std::size_t>(part[i]);
    const std::size_t stride = (size[c] + share - 1) / share;
    if (seen[c]++ % stride != 0) continue;
    const Triangle& t = mesh.triangles[i];
    const Vec3 a = area_vector(mesh, t);
    Vec3 center = Vec3::Zero();
    double longest = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& v = mesh.vertices[static_cast<std::size_t>(t[k])];
      center += v / 3;
      longest = std::max(longest, (mesh.vertices[static_cast<std::size_t>(t[(k + 1) % 3])] - v).norm());
    }
    const double step = 1e-4 * a.norm() / longest;
    if (!(step > 1e-13 * center.norm())) continue;
    const double w = std::round(winding.at(center + step * a.normalized()));
    result.mean[c] += w;
    ++taken[c];
    result.all_zero = result.all_zero && w == 0;
  }
  for (std::size_t c = 0; c < parts; ++c)
    if (taken[c] > 0) result.mean[c] /= static_cast<double>(taken[c]);
  return result;
}

// Sum of the unit normals at each edge, three a triangle; unit where they do not cancel.
std::vector<Vec3> sum_at_edges(const std::vector<Triangle>& triangles, const std::vector<Vec3>& normals) {
  struct Edge {
    std::uint64_t key;
    std::size_t slot;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * triangles.size());
  for (std::size_t i = 0; i < triangles.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto u = static_cast<std::uint64_t>(triangles[i][k]);
      const auto v = static_cast<std::uint64_t>(triangles[i][(k + 1) % 3]);
      edges.push_back({std::min(u, v) << 32 | std::max(u, v), 3 * i + k});
    }
  std::sort(edges.begin(), edges.end(),
            [](const Edge& a, const Edge& b) { return a.key != b.key ? a.key < b.key : a.slot < b.slot; });
  std::vector<Vec3> result(edges.size());
  for (std::size_t i = 0, j; i < edges.size(); i = j) {
    Vec3 sum = Vec3::Zero();
    for (j = i; j < edges.size() && edges[j].key == edges[i].key; ++j) sum += normals[edges[j].slot / 3];
    for (std::size_t k = i; k < j; ++k)
      result[edges[k].slot] = sum.norm() > 1e-9 ? Vec3(sum.normalized()) : Vec3::Zero();
  }
  return result;
}

void turn(Triangle& t) { std::swap(t[1], t[2]); }

}  // namespace

const char* name(SignMethod method) {
  return method == SignMethod::pseudonormal ? "pseudonormal" : "winding number";
}

struct SignedDistanceField::Prepared {
  TriangleMesh mesh;
  std::vector<Vec3> face_normals, edge_normals;
  SignMethod method = SignMethod::winding;
  std::string reason;
  bool closed = false;
  bool flipped = false;
  std::size_t flipped_parts = 0;
};

SignedDistanceField::Prepared SignedDistanceField::prepare(const TriangleMesh& mesh,
                                                           std::optional<SignMethod> method) {
  require_usable(mesh);
  Prepared p;
  p.mesh = mesh;
  drop_duplicates(p.mesh);
  const MeshReport report = check(p.mesh);
  const bool closed = p.closed = report.closed() && report.oriented();
  p.flipped = (closed ? report.volume : volume_about_center(p.mesh)) < 0;
  if (p.flipped)
    for (Triangle& t : p.mesh.triangles) turn(t);

  if (!report.closed())
    p.reason = report.open_edges > 0 ? "open edges" : "edges of more than two triangles";
  else if (!report.oriented())
    p.reason = "neighbouring triangles face opposite ways";
  if (closed) {
    const std::vector<Index> part = components(p.mesh);
    Outside outside;
    for (int round = 0; round < 4; ++round) {  // turning a part may show another one
      outside = sample_outside(p.mesh, part, report.components);
      std::vector<char> inverted(report.components, 0);
      std::size_t count = 0;
      for (std::size_t c = 0; c < inverted.size(); ++c)
        if (outside.mean[c] < -0.5 && outside.mean[c] > -1.5) inverted[c] = 1, ++count;
      if (count == 0) break;
      for (std::size_t i = 0; i < part.size(); ++i)
        if (inverted[static_cast<std::size_t>(part[i])]) turn(p.mesh.triangles[i]);
      p.flipped_parts += count;
    }
    if (!outside.all_zero) p.reason = "parts overlap or the surface crosses itself";
  }
  p.face_normals.reserve(p.mesh.triangles.size());
  for (const Triangle& t : p.mesh.triangles) p.face_normals.push_back(area_vector(p.mesh, t).normalized());
  p.edge_normals = sum_at_edges(p.mesh.triangles, p.face_normals);
  if (p.reason.empty() && !method) {
    if (std::any_of(p.mesh.triangles.begin(), p.mesh.triangles.end(),
                    [&](const Triangle& t) { return flatness(p.mesh, t) < 1e-7; }))
      p.reason = "triangles without area";
    else if (std::any_of(p.edge_normals.begin(), p.edge_normals.end(),
                         [](const Vec3& n) { return n.isZero(0); }))
      p.reason = "triangles folded onto each other";
    else if (crosses_itself(p.mesh, Bvh(p.mesh)))
      p.reason = "the surface crosses or touches itself";
    else
      p.method = SignMethod::pseudonormal;
  }
  if (method) p.method = *method, p.reason.clear();
  return p;
}

SignedDistanceField::SignedDistanceField(const TriangleMesh& mesh, std::optional<SignMethod> method)
    : SignedDistanceField(prepare(mesh, method)) {}

SignedDistanceField::SignedDistanceField(Prepared&& p)
    : bvh_(p.mesh),
      method_(p.method),
      closed_(p.closed),
      reason_(std::move(p.reason)),
      flipped_(p.flipped),
      flipped_parts_(p.flipped_parts),
      face_normals_(std::move(p.face_normals)),
      edge_normals_(std::move(p.edge_normals)),
      vertex_normals_(vertex_normals(p.mesh)) {
  if (method_ == SignMethod::winding) winding_.emplace(p.mesh);
  triangles_ = std::move(p.mesh.triangles);
}

Vec3 SignedDistanceField::pseudonormal(const ClosestPoint& c) const {
  const auto t = static_cast<std::size_t>(c.triangle), f = static_cast<std::size_t>(c.feature);
  if (c.feature == Feature::face) return face_normals_[t];
  return f < 3 ? vertex_normals_[static_cast<std::size_t>(triangles_[t][f])] : edge_normals_[3 * t + f - 3];
}

SignedDistance SignedDistanceField::at(const Vec3& p, double bound_squared, Index hint) const {
  return with_sign(p, bvh_.closest(p, bound_squared, hint));
}

SignedDistance SignedDistanceField::beside(const Vec3& p, const Vec3& before,
                                           const SignedDistance& there) const {
  const ClosestPoint c =
      bvh_.closest(p, std::numeric_limits<double>::infinity(), std::max(there.triangle, Index{-1}));
  if (!closed_ || there.triangle < 0 || c.triangle < 0 ||
      !(1.0001 * (p - before).norm() < std::abs(there.distance)))
    return with_sign(p, c);
  const double d = std::sqrt(c.distance_squared);
  return {there.distance < 0 ? -d : d, c.point, Vec3::Zero(), c.triangle};
}

SignedDistance SignedDistanceField::with_sign(const Vec3& p, const ClosestPoint& c) const {
  SignedDistance r;
  r.triangle = c.triangle;
  if (c.triangle < 0) {
    r.distance =
        p.allFinite() ? std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
    return r;
  }
  r.point = c.point;
  r.normal = pseudonormal(c);
  const Vec3 away = p - c.point;
  const double d = std::sqrt(c.distance_squared), side = away.dot(r.normal);
  const bool in = method_ == SignMethod::pseudonormal ? side < 0 : d > 0 && winding_->at(p) > 0.5;
  r.distance = in ? -d : d;
  if (method_ == SignMethod::winding && (in ? side > 0 : side < 0)) r.normal = -r.normal;
  if (!(r.normal.squaredNorm() > 0)) r.normal = d > 0 ? Vec3(away / r.distance) : Vec3::UnitZ();
  return r;
}

bool SignedDistanceField::inside(const Vec3& p) const {
  if (method_ == SignMethod::winding) return winding_->at(p) > 0.5;
  return at(p).distance < 0;
}

}  // namespace palpate
