// Exact signed distance to a surface: closest point by the BVH, sign by pseudonormal where the surface is
// closed and oriented, by generalised winding number where it is not. Baerentzen, Aanaes, "Signed distance
// computation using the angle weighted pseudonormal" (2005).
#pragma once

#include <optional>
#include <vector>

#include "palpate/geometry/bvh.hpp"
#include "palpate/geometry/winding_number.hpp"

namespace palpate {

enum class SignMethod : std::uint8_t { pseudonormal, winding };
const char* name(SignMethod method);

struct SignedDistance {
  double distance = 0;         // m, negative inside
  Vec3 point = Vec3::Zero();   // closest point of the surface, m
  Vec3 normal = Vec3::Zero();  // pseudonormal there (unit, outwards)
};

// Built once, then const and thread-safe.
class SignedDistanceField {
 public:
  // Chooses the sign's method from the mesh unless given. A closed oriented surface that faces inwards
  // (negative volume) counts as facing outwards: organs are not the space around them.
  // Throws Error(geometry) when there is no triangle.
  explicit SignedDistanceField(const TriangleMesh& mesh, std::optional<SignMethod> method = {});
  SignedDistance at(const Vec3& p, double bound_squared = std::numeric_limits<double>::infinity()) const;
  bool inside(const Vec3& p) const;
  SignMethod method() const { return method_; }
  bool flipped() const { return orientation_ < 0; }

 private:
  Bvh bvh_;
  std::optional<WindingNumber> winding_;
  SignMethod method_;
  double orientation_ = 1;  // -1: the triangles face inwards
  std::vector<Triangle> triangles_;
  std::vector<Vec3> face_normals_, edge_normals_,
      vertex_normals_;  // edge_normals_: three a triangle, edges 01 12 20
};

}  // namespace palpate
