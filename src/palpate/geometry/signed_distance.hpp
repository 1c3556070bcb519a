// Exact signed distance to a surface: closest point by the BVH, sign by pseudonormal where the surface is
// closed and oriented, by generalised winding number where it is not. Baerentzen, Aanaes, "Signed distance
// computation using the angle weighted pseudonormal" (2005).
#pragma once

#include <optional>
#include <string>
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
  Index triangle = -1;         // of the closest point: the hint for a neighbouring query
};

// Built once, then const and thread-safe. Triangles on the same three vertices count once.
//
// What is inside: closed oriented surfaces whose volume is negative are turned over as a whole (organs are
// not the space around them), then each closed part that faces inwards and lies in no other part. After that
// a point is inside where the winding number exceeds 1/2: a part facing inwards within another is a cavity,
// one facing outwards is solid, and parts that overlap are united.
class SignedDistanceField {
 public:
  // Chooses the sign's method from the mesh unless given: pseudonormals on closed oriented surfaces that do
  // not cross, touch or fold onto themselves, have no flat triangles, and just outside of which the winding
  // number, sampled along the surface, is 0; else winding. Throws Error(geometry) when there is no triangle,
  // a vertex is no number or an index is out of range.
  explicit SignedDistanceField(const TriangleMesh& mesh, std::optional<SignMethod> method = {});
  // Beyond the bound: distance infinite, triangle -1. Where p is no number: distance NaN.
  SignedDistance at(const Vec3& p, double bound_squared = std::numeric_limits<double>::infinity(),
                    Index hint = -1) const;
  // The same as at(p), sooner where p is near `before`, whose answer `there` was: its triangle starts the
  // search, and its sign holds where no surface can be between. (Then without a normal.)
  SignedDistance beside(const Vec3& p, const Vec3& before, const SignedDistance& there) const;
  bool inside(const Vec3& p) const;
  SignMethod method() const { return method_; }
  // Why not pseudonormals, in words; empty when they are used or the caller chose.
  const std::string& reason() const { return reason_; }
  // Whether the surface faced inwards and was turned over, and how many parts were besides.
  bool flipped() const { return flipped_; }
  std::size_t flipped_parts() const { return flipped_parts_; }

 private:
  struct Prepared;  // the surface as it is used, and the choice
  static Prepared prepare(const TriangleMesh& mesh, std::optional<SignMethod> method);
  explicit SignedDistanceField(Prepared&& prepared);
  Vec3 pseudonormal(const ClosestPoint& c) const;
  SignedDistance with_sign(const Vec3& p, const ClosestPoint& c) const;

  Bvh bvh_;
  std::optional<WindingNumber> winding_;
  SignMethod method_;
  bool closed_ = false;  // and oriented: the sign changes at the surface only
  std::string reason_;
  bool flipped_ = false;
  std::size_t flipped_parts_ = 0;
  std::vector<Triangle> triangles_;
  std::vector<Vec3> face_normals_, edge_normals_,
      vertex_normals_;  // edge_normals_: three a triangle, edges 01 12 20
};

}  // namespace palpate
