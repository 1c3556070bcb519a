#include "palpate/haptics/coupling.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {

constexpr double pi = 3.14159265358979323846;

Vec3 cut(const Vec3& v, double limit) {
  const double length = v.stableNorm();
  return length > limit ? Vec3(v * (limit / length)) : v;
}

Vec3 finite_or_zero(const Vec3& v) { return v.allFinite() ? v : Vec3(Vec3::Zero()); }

// Solves B e1 + dt sat(K e1) = B e0 + dt F for e1.
Vec3 settle(double stiffness, double damping, double limit, const Vec3& e0, const Vec3& force, double dt) {
  const Vec3 a = damping * e0 + dt * force;
  const double length = a.stableNorm(), elastic = damping + stiffness * dt;
  if (length <= limit / stiffness * elastic) return a / elastic;
  return a * ((length - dt * limit) / (damping * length));
}

// The shorter way round, rad.
Vec3 rotation_vector(const Eigen::Quaterniond& q) {
  const double sine = q.vec().norm();
  if (sine < 1e-12) return Vec3::Zero();
  return q.vec() * (2 * std::atan2(std::copysign(sine, q.w()), std::abs(q.w())) / sine);
}

Eigen::Quaterniond rotation(const Vec3& v) {
  const double angle = v.norm();
  if (angle < 1e-12) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, v / angle));
}

// Far away is not finite either: a kilometre.
bool good(const Pose& p) {
  return p.translation.allFinite() && p.translation.cwiseAbs().maxCoeff() < 1e3 &&
         p.rotation.coeffs().allFinite() && std::abs(p.rotation.norm() - 1) < 1e-2;
}

}  // namespace

void check(const CouplingSettings& s) {
  for (const auto& [name, value] : {std::pair{"stiffness", s.stiffness},
                                    {"damping", s.damping},
                                    {"force limit", s.force_limit},
                                    {"angular stiffness", s.angular_stiffness},
                                    {"angular damping", s.angular_damping},
                                    {"torque limit", s.torque_limit},
                                    {"speed limit", s.speed_limit},
                                    {"angular speed limit", s.angular_speed_limit},
                                    {"ramp", s.ramp},
                                    {"tick", s.tick}})
    if (!(value > 0 && std::isfinite(value)))
      throw Error(ErrorKind::usage, "coupling: the {} is {}; use more than 0", name, value);
}

Pose couple(const CouplingSettings& s, CouplingState& state, const DeviceSample& sample,
            const Wrench& contact, double dt) noexcept {
  if (!(dt > 0)) return state.instrument;
  const bool lost = !sample.connected || !good(sample.pose);
  const double counted = std::min(dt, s.tick);
  state.gain = std::clamp(state.gain + (lost ? -dt : counted) / s.ramp, 0.0, 1.0);
  if (lost) return state.instrument;
  const Pose handle{sample.pose.rotation.normalized(), sample.pose.translation};
  if (!state.started) {
    state.started = true;
    return state.instrument = handle;
  }

  // The damper holds the offsets of the last tick while the handle moves; the speed limit has the last word.
  Pose& at = state.instrument;
  const Vec3 offset =
      settle(s.stiffness, s.damping, s.force_limit, state.offset, finite_or_zero(contact.force), counted);
  at.translation += cut(handle.translation + offset - at.translation, s.speed_limit * counted);
  state.offset = at.translation - handle.translation;

  const Vec3 angular_offset = settle(s.angular_stiffness, s.angular_damping, s.torque_limit,
                                     state.angular_offset, finite_or_zero(contact.torque), counted);
  const Eigen::Quaterniond towards =
      rotation(cut(angular_offset, pi)) * handle.rotation * at.rotation.conjugate();
  at.rotation =
      (rotation(cut(rotation_vector(towards), s.angular_speed_limit * counted)) * at.rotation).normalized();
  state.angular_offset = rotation_vector(at.rotation * handle.rotation.conjugate());
  return at;
}

Wrench hand_wrench(const CouplingSettings& s, const CouplingState& state, const Wrench& contact) noexcept {
  return {state.gain * cut(finite_or_zero(contact.force), s.force_limit),
          state.gain * cut(finite_or_zero(contact.torque), s.torque_limit)};
}

}  // namespace palpate
