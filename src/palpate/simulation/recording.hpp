// What went into each tick, and a hash of what came out now and then: a run can be replayed and compared bit
// by bit, with or without threads, on any machine that has the same model file.
#pragma once

#include <filesystem>
#include <vector>

#include "palpate/simulation/organs.hpp"

namespace palpate {

// Of everything a tick decides: status, contacts, forces, and what these do where they act.
std::uint64_t state_hash(const State& state) noexcept;
// Of several organs' states together; of one the same as above.
std::uint64_t state_hash(std::span<const State> states) noexcept;

class Recording {
 public:
  static constexpr std::uint64_t hash_every = 1000;  // ticks

  Recording() = default;
  // For up to so many ticks: memory is taken now, add() allocates nothing.
  Recording(std::span<const Model> models, std::uint64_t ticks);
  Recording(const Model& model, std::uint64_t ticks) : Recording(std::span(&model, 1), ticks) {}

  // In the order of the ticks. False where there is no more room, or it is another model's: that tick is not
  // recorded, and write() will say so.
  bool add(std::span<const Input> inputs, std::span<const State> states) noexcept;
  bool add(const Input& input, const State& state) noexcept {
    return add(std::span(&input, 1), std::span(&state, 1));
  }
  std::uint64_t ticks() const noexcept { return times_.size(); }
  // Tick k's input, into one an organ that has its instruments and grips.
  void set_inputs(std::uint64_t k, std::span<Input> inputs) const noexcept;
  void set_input(std::uint64_t k, Input& input) const noexcept { set_inputs(k, std::span(&input, 1)); }
  // Whether the state after tick k is the one that was recorded; true for ticks without a hash.
  bool agrees(std::uint64_t k, std::span<const State> states) const noexcept;
  bool agrees(std::uint64_t k, const State& state) const noexcept { return agrees(k, std::span(&state, 1)); }
  std::size_t organs() const noexcept { return organs_; }
  std::size_t instruments() const noexcept { return instruments_; }
  std::uint64_t hashes() const noexcept { return hashes_.size(); }
  // Of the model that was run: mesh, materials, anchors (organ_hash). Of several: of theirs together.
  std::uint64_t organ() const noexcept { return organ_; }
  // Whether it was made with these organs and as many instruments.
  bool made_with(std::span<const Model> models) const noexcept;

  // HDF5, container kind "recording": time, poses (ticks x bodies x 7: position, quaternion w x y z; the
  // organs first), grips (ticks x instruments; where one was ever closed), hashes. Error(usage) where ticks
  // were not recorded: what is cut short would replay as if it were all.
  void write(const std::filesystem::path& path, const std::string& provenance) const;
  static Recording read(const std::filesystem::path& path);  // Error(file | format)

 private:
  static constexpr std::size_t per_pose = 7;
  bool has_hash(std::uint64_t k) const noexcept { return (k + 1) % hash_every == 0; }

  std::size_t bodies() const noexcept { return organs_ + instruments_; }

  std::size_t organs_ = 1, instruments_ = 0;
  std::uint64_t organ_ = 0;
  std::vector<double> times_, poses_;
  std::vector<std::uint8_t> grips_;        // [tick][instrument]
  std::vector<std::int64_t> hashes_;       // after ticks 999, 1999, ... and the last one
  std::uint64_t last_ = 0;                 // hash after the last tick
  std::uint64_t room_ = 0, left_out_ = 0;  // ticks
};

}  // namespace palpate
