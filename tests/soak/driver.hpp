// Leads a scene's instruments at random, with faults, and checks what comes out of each tick.
#pragma once

#include <atomic>
#include <string>

#include "palpate/haptics/coupling.hpp"
#include "palpate/haptics/watchdog.hpp"
#include "soak/random_scene.hpp"

namespace palpate::soak {

struct Met {
  std::uint64_t bad_inputs = 0, touching = 0, not_converged = 0, full = 0, lost = 0, grasping = 0;  // ticks
};

class Driver {
 public:
  // coupled: a simulated hand with a device leads the first instrument.
  Driver(std::span<const Model> models, std::uint64_t seed, std::uint64_t ticks, bool coupled);

  // Force thread. The inputs of tick k, or false after the last. Then the states after it.
  bool lead(std::uint64_t k, std::span<const State> before, std::span<Input> inputs);
  void check(std::uint64_t k, std::span<const State> states);
  // Any one thread.
  void check_surface(const Surface& surface);

  std::uint64_t ticks() const { return ticks_ + leaving; }
  const Met& met() const { return met_; }
  // After the run: "tick 12: ...", empty where all was well.
  std::string complaint() const;

 private:
  static constexpr std::uint64_t leaving = 5;  // ticks at the end, all instruments a metre away
  void complain(std::uint64_t k, std::string text);
  struct Before {  // the tick under way, of an organ
    bool must_refuse = false;
    std::uint64_t loads = 0;
    std::vector<Wrench> wrenches;
  };
  void lead_by_hand(std::span<const State> before, std::span<Input> inputs);
  void add_fault(std::span<Input> inputs);
  void check_one(std::uint64_t k, const State& state, const Before& before);
  void check_grips(std::uint64_t k, const State& state);
  void check_hand(std::uint64_t k, std::span<const State> states);

  std::span<const Model> models_;
  Random random_;
  std::uint64_t ticks_;
  std::vector<Wanderer> ways_;
  Pose organ_;
  std::vector<Vec3> beside_;  // where each organ is from there
  std::vector<std::uint8_t> grips_;
  bool away_ = false;
  std::vector<Before> before_;  // of each organ

  std::unique_ptr<HapticDevice> device_;
  CouplingSettings settings_;
  CouplingState coupling_;
  Watchdog watchdog_;
  double clock_ = 0;  // s
  // Ticks without a device, and with an input of the first organ that no step takes.
  int lost_for_ = 0, lose_ = 0, refused_for_ = 0, refuse_ = 0;
  Met met_;
  std::string complaint_;
  std::atomic<bool> bad_surface_{false};
};

}  // namespace palpate::soak
