#include "palpate/simulation/drawing.hpp"

#include "palpate/base/error.hpp"
#include "palpate/geometry/bvh.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

}  // namespace

Drawing embed(TriangleMesh surface, const TriangleMesh& organ) {
  if (surface.triangles.empty()) throw Error(ErrorKind::geometry, "the drawing surface has no triangles");
  const Bvh tree(organ);
  const double reach = 0.1 * bounding_box(organ.vertices).diagonal();
  Drawing out;
  out.surface = std::move(surface);
  Index hint = -1;
  for (std::size_t i = 0; i < out.surface.vertices.size(); ++i) {
    const Vec3& p = out.surface.vertices[i];
    const ClosestPoint near = tree.closest(p, std::numeric_limits<double>::infinity(), hint);
    if (near.triangle < 0 || near.distance_squared > reach * reach)
      throw Error(
          ErrorKind::geometry,
          "vertex {} of the drawing surface ({:.5g} {:.5g} {:.5g} m) is {:.3g} m from the organ, which "
          "measures {:.3g} m; is it the same organ, in the same unit?",
          i, p.x(), p.y(), p.z(), std::sqrt(near.distance_squared), 10 * reach);
    hint = near.triangle;
    const Triangle& t = organ.triangles[at(near.triangle)];
    const Vec3 &a = organ.vertices[at(t[0])], ab = organ.vertices[at(t[1])] - a,
               ac = organ.vertices[at(t[2])] - a, n = ab.cross(ac), r = p - a;
    const double b = r.cross(ac).dot(n) / n.squaredNorm(), c = ab.cross(r).dot(n) / n.squaredNorm();
    out.triangle.push_back(near.triangle);
    out.ride.push_back(Eigen::Vector4d(1 - b - c, b, c, r.dot(n.normalized())).cast<float>());
  }
  return out;
}

void draw(const Drawing& drawing, const TriangleMesh& organ, std::span<const Vec3> nodes,
          std::span<Vec3> positions) noexcept {
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Triangle& t = organ.triangles[at(drawing.triangle[i])];
    const Vec3 &a = nodes[at(t[0])], &b = nodes[at(t[1])], &c = nodes[at(t[2])];
    const Eigen::Vector4d ride = drawing.ride[i].cast<double>();
    // A triangle pressed flat has no normal: the height is then left out.
    const Vec3 n = (b - a).cross(c - a);
    positions[i] = ride[0] * a + ride[1] * b + ride[2] * c + ride[3] * n.normalized();
  }
}

}  // namespace palpate
