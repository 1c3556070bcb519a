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

struct Spring {
  double stiffness, damping, stiffest, limit;
};

// The offset after a tick of dt in which the handle moved, with the contact's force as the last step found
// it.
Vec3 settle(const Spring& s, CoupledMotion& m, const Vec3& force, const Vec3& handle_moved, double dt) {
  // The secant: what the force along itself did over the last tick; quick to learn, slower to forget. A
  // contact that comes and goes is stiffer than it looks: the tick in which it begins was partly in the air.
  const double strength = force.stableNorm();
  const Vec3 n = strength > 0 ? Vec3(force / strength) : Vec3(Vec3::Zero());
  const double way = m.moved.dot(n);
  if (std::abs(way) > 1e-9) {
    const double measured = (m.force - force).dot(n) / way;
    const double known = (m.force == Vec3::Zero() ? 2 : 0.9) * m.secant;
    m.secant = std::min(std::max(measured, known), s.stiffest);
  }
  m.force = force;

  // Across n the damper alone, along n the damper and the contact.
  const double across = s.damping, along = s.damping + (strength > 0 ? m.secant * dt : 0);
  const auto weigh = [&](const Vec3& v, double a, double b) { return Vec3(a * v + (b - a) * v.dot(n) * n); };
  const Vec3 a = weigh(m.offset, across, along) + dt * force - (along - across) * handle_moved.dot(n) * n;
  const Vec3 e = weigh(a, 1 / (across + s.stiffness * dt), 1 / (along + s.stiffness * dt));
  const double length = e.stableNorm();
  if (length * s.stiffness <= s.limit) return e;
  return weigh(a - e * (dt * s.limit / length), 1 / across, 1 / along);
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
                                    {"stiffest contact", s.stiffest},
                                    {"force limit", s.force_limit},
                                    {"angular stiffness", s.angular_stiffness},
                                    {"angular damping", s.angular_damping},
                                    {"stiffest angular contact", s.angular_stiffest},
                                    {"torque limit", s.torque_limit},
                                    {"speed limit", s.speed_limit},
                                    {"angular speed limit", s.angular_speed_limit},
                                    {"ramp", s.ramp},
                                    {"tick", s.tick}})
    if (!(value > 0 && std::isfinite(value)))
      throw Error(ErrorKind::usage, "coupling: the {} is {}; use more than 0", name, value);
}

Pose couple(const CouplingSettings& s, CouplingState& state, const DeviceSample& sample,
            const Wrench& contact, double dt, bool taken) noexcept {
  if (!(dt > 0)) return state.instrument;
  const bool lost = !sample.connected || !good(sample.pose) || !taken;
  const double counted = std::min(dt, s.tick);
  state.gain = std::clamp(state.gain + (lost ? -dt : counted) / s.ramp, 0.0, 1.0);
  if (lost) return state.instrument;
  const Pose handle{sample.pose.rotation.normalized(), sample.pose.translation};
  if (!state.started) {
    state.started = true;
    return state.instrument = state.handle = handle;
  }

  // Where spring, damper and contact want it; the speed limit has the last word.
  Pose& at = state.instrument;
  CoupledMotion &t = state.translation, &r = state.rotation;
  const Vec3 offset =
      settle({s.stiffness, s.damping, s.stiffest, s.force_limit}, t, finite_or_zero(contact.force),
             handle.translation - state.handle.translation, counted);
  t.moved = cut(handle.translation + offset - at.translation, s.speed_limit * counted);
  at.translation += t.moved;
  t.offset = at.translation - handle.translation;

  const Vec3 turned = rotation_vector(handle.rotation * state.handle.rotation.conjugate());
  const Vec3 angular_offset =
      settle({s.angular_stiffness, s.angular_damping, s.angular_stiffest, s.torque_limit}, r,
             finite_or_zero(contact.torque), turned, counted);
  r.moved =
      cut(rotation_vector(rotation(cut(angular_offset, pi)) * handle.rotation * at.rotation.conjugate()),
          s.angular_speed_limit * counted);
  at.rotation = (rotation(r.moved) * at.rotation).normalized();
  r.offset = rotation_vector(at.rotation * handle.rotation.conjugate());
  state.handle = handle;
  return at;
}

Wrench hand_wrench(const CouplingSettings& s, const CouplingState& state, const Wrench& contact) noexcept {
  return {state.gain * cut(finite_or_zero(contact.force), s.force_limit),
          state.gain * cut(finite_or_zero(contact.torque), s.torque_limit)};
}

}  // namespace palpate
