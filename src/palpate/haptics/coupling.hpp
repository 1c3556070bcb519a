// Virtual coupling: a spring and a damper between the device's handle and the instrument in the simulation,
// so that neither the stiffness of the contact nor a bad sample reaches the other side as it is.
//   Colgate, Stanley, Brown: Issues in the haptic display of tool use. IROS 1995.
//   Zilles, Salisbury: A constraint-based god-object method for haptic display. IROS 1995.
//   Adams, Hannaford: Stable haptic interaction with virtual environments. IEEE Trans. Rob. Autom. 15 (1999).
//
// The instrument has no mass. With e its offset from the handle and F the contact's force on it,
//     B e' + sat(K e) = F.
// F is known for the last tick's pose only; at the next it is about F - q n n.(x1 - x0), with n its direction
// and q the secant stiffness that the contact showed in the last ticks. One tick solves, implicit in K and q,
//     B (e1 - e0) + dt sat(K e1) = dt (F0 - q n n.(x1 - x0)),   x1 - x0 = handle's motion + e1 - e0,
// and the same for the rotation. The damper acts between handle and instrument: moving in the air costs
// nothing. The spring gives no more than the force limit, so a handle far inside an organ does not drag the
// instrument in with more than that.
//
// Stability. For a contact of stiffness k (N/m) a tick multiplies the error of e by
//     (B + q dt - k dt) / (B + q dt + K dt):
// e settles without overshoot if k <= q + B / dt, and settles at all if k < K + 2 (q + B / dt). Without any
// secant (q = 0, the first touch) these are 10,000 and 21,000 N/m for the defaults at 1 kHz; with rotation
// and r the lever arm of the contact, no overshoot needs k dt (1 / B + r^2 / B_r) <= 1: 5,000 N/m at r = 0.1
// m. q learns what is stiffer, up to `stiffest`: contacts of 100,000 N/m come to rest after a few ticks of
// chatter. A tick counts for `tick` seconds at most: one that comes late moves the instrument less, never
// less stably.
//
// The hand feels the contact's force at the new pose, which is that of spring and damper. In motion at v
// against a spring k it exceeds the static force by a^2 B v or a little more, with a = k / (K + k):
// dissipation, which outweighs what holding the force over a tick generates (a K v dt / 2, Colgate) if k > 50
// N/m at the defaults; below, at most K^2 dt^2 / 16 B = 0.006 N s/m of damping is missing, less than any
// device's friction.
#pragma once

#include "palpate/haptics/device.hpp"

namespace palpate {

struct CouplingSettings {
  double stiffness = 1000;          // N/m
  double damping = 10;              // N s/m
  double stiffest = 1e6;            // N/m, of the contacts that the coupling adapts to
  double force_limit = 8;           // N
  double angular_stiffness = 10;    // N m/rad
  double angular_damping = 0.1;     // N m s/rad
  double angular_stiffest = 1e4;    // N m/rad, likewise
  double torque_limit = 1;          // N m
  double speed_limit = 1;           // m/s, of the instrument
  double angular_speed_limit = 20;  // rad/s, of the instrument
  double ramp = 0.05;  // s, from no force to full force after the device appears, and back when it is lost
  double tick = 1e-3;  // s, the longest time a tick counts for
};
// Error(usage) naming the setting that is not above zero.
void check(const CouplingSettings& settings);

// Translation (m, N) or rotation (rad, N m) of the instrument.
struct CoupledMotion {
  Vec3 offset = Vec3::Zero();  // e: from the handle to the instrument
  Vec3 moved = Vec3::Zero();   // the instrument, in the last tick
  Vec3 force = Vec3::Zero();   // of the contact, a tick ago
  double secant = 0;           // q: stiffness of the contact
};
struct CouplingState {
  // World, of the last tick. Before the first good sample the instrument waits where the caller puts it.
  Pose instrument, handle;
  CoupledMotion translation, rotation;
  double gain = 0;       // of the force, 0 to 1
  bool started = false;  // by the first good sample: the instrument appears where the handle is
};

// One tick: where the instrument goes. contact: on the instrument, about its origin, as the last step found
// it. dt: s since the last tick; zero, negative or NaN moves nothing. Without a device, or with a sample that
// is not finite, the instrument stays and the gain falls; so they do where the last step did not take its
// input (`taken`, see is_taken in organs.hpp), as the contact is then one of long ago. Never throws,
// allocates or locks.
Pose couple(const CouplingSettings& settings, CouplingState& state, const DeviceSample& sample,
            const Wrench& contact, double dt, bool taken = true) noexcept;

// What the hand feels: the contact's wrench at the instrument's new pose, cut to the limits with its
// direction kept, times the gain. Zero for what is not finite.
Wrench hand_wrench(const CouplingSettings& settings, const CouplingState& state,
                   const Wrench& contact) noexcept;

}  // namespace palpate
