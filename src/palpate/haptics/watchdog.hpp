// The force must not stay on when the force loop stops. Two threads share a Watchdog: the force loop calls
// tick, the driver's own thread multiplies what it sends by scale.
#pragma once

#include <algorithm>
#include <atomic>
#include <limits>

namespace palpate {

class Watchdog {
 public:
  // patience: s without a tick that are no reason to worry; ramp: s from full force to none, and back.
  explicit Watchdog(double patience = 0.02, double ramp = 0.05) noexcept : patience_(patience), ramp_(ramp) {}

  // Force loop: it is alive. now: s, of any one clock that does not go back.
  void tick(double now) noexcept { ticked_.store(now, std::memory_order_relaxed); }

  // Driver's thread, whenever it sends: 0 before the first tick, rising to 1 over the ramp while ticks come,
  // falling to 0 over the ramp when they have stopped for longer than the patience.
  double scale(double now) noexcept {
    const bool alive = now - ticked_.load(std::memory_order_relaxed) <= patience_;
    const double most = std::max(0.0, now - asked_) / ramp_;
    scale_ = std::clamp(scale_ + (alive ? most : -most), 0.0, 1.0);
    asked_ = now;
    return scale_;
  }

 private:
  const double patience_, ramp_;
  std::atomic<double> ticked_{-std::numeric_limits<double>::infinity()};
  double scale_ = 0, asked_ = std::numeric_limits<double>::infinity();  // the driver's thread
};

}  // namespace palpate
