// Leads a scene's instruments at random, with faults, and checks what comes out of each tick.
#pragma once

#include <atomic>
#include <string>

#include "palpate/haptics/coupling.hpp"
#include "palpate/haptics/watchdog.hpp"
#include "soak/random_scene.hpp"

namespace palpate::soak {

struct Met {
  std::uint64_t bad_inputs = 0, touching = 0, not_converged = 0, full = 0, lost = 0;  // ticks
};

class Driver {
 public:
  // coupled: a simulated hand with a device leads the first instrument.
  Driver(const Model& model, std::uint64_t seed, std::uint64_t ticks, bool coupled);

  // Force thread. The input of tick k, or false after the last. Then the state after it.
  bool lead(std::uint64_t k, const State& before, Input& input);
  void check(std::uint64_t k, const State& state);
  // Any one thread.
  void check_surface(const Surface& surface);

  std::uint64_t ticks() const { return ticks_ + leaving; }
  const Met& met() const { return met_; }
  // After the run: "tick 12: ...", empty where all was well.
  std::string complaint() const;

 private:
  static constexpr std::uint64_t leaving = 5;  // ticks at the end, all instruments a metre away
  void complain(std::uint64_t k, std::string text);
  void lead_by_hand(const State& before, Input& input);
  void add_fault(Input& input);
  void check_hand(std::uint64_t k, const State& state);

  const Model& model_;
  Random random_;
  std::uint64_t ticks_;
  std::vector<Wanderer> ways_;
  Pose organ_;
  // Of the tick under way.
  bool must_refuse_ = false, away_ = false;
  std::uint64_t loads_before_ = 0;
  std::vector<Wrench> wrenches_before_;

  std::unique_ptr<HapticDevice> device_;
  CouplingSettings settings_;
  CouplingState coupling_;
  Watchdog watchdog_;
  double clock_ = 0;             // s
  int lost_for_ = 0, lose_ = 0;  // ticks
  Met met_;
  std::string complaint_;
  std::atomic<bool> bad_surface_{false};
};

}  // namespace palpate::soak
