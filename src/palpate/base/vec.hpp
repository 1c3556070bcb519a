// Small vectors, index types, boxes and poses. SI units; float64 offline, float32 online.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace palpate {

using Vec3 = Eigen::Vector3d;
using Vec3f = Eigen::Vector3f;
using Mat3 = Eigen::Matrix3d;
using Index = std::int32_t;                // node, triangle and tetrahedron numbers
using Triangle = std::array<Index, 3>;     // counter-clockwise seen from outside
using Tetrahedron = std::array<Index, 4>;  // (b-a)x(c-a).(d-a) > 0

// Axis-parallel box, m. Empty (min > max) when default constructed.
struct Box {
  Vec3 min = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 max = Vec3::Constant(-std::numeric_limits<double>::infinity());

  bool empty() const { return !(min.array() <= max.array()).all(); }
  Vec3 size() const { return max - min; }
  Vec3 center() const { return 0.5 * (min + max); }
  double diagonal() const { return empty() ? 0.0 : size().norm(); }
  bool contains(const Vec3& p) const {
    return (p.array() >= min.array()).all() && (p.array() <= max.array()).all();
  }
  bool intersects(const Box& b) const {
    return (min.array() <= b.max.array()).all() && (max.array() >= b.min.array()).all();
  }
  void add(const Vec3& p) { min = min.cwiseMin(p), max = max.cwiseMax(p); }
  void add(const Box& b) { min = min.cwiseMin(b.min), max = max.cwiseMax(b.max); }
  Box grown(double margin) const { return {min - Vec3::Constant(margin), max + Vec3::Constant(margin)}; }
};

inline Box bounding_box(std::span<const Vec3> points) {
  Box box;
  for (const Vec3& p : points) box.add(p);
  return box;
}

// Rigid placement of a body: world = rotation * body + translation. Unit quaternion, metres.
struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Vec3 translation = Vec3::Zero();

  Vec3 operator*(const Vec3& p) const { return rotation * p + translation; }
  Pose operator*(const Pose& b) const {
    return {(rotation * b.rotation).normalized(), *this * b.translation};
  }
  Pose inverse() const {
    const Eigen::Quaterniond r = rotation.conjugate();
    return {r, -(r * translation)};
  }
};

}  // namespace palpate
