// What `simulate` and `demo` share: the loop over a motion with its recording, and the contact sheet of the
// run.
#pragma once

#include <filesystem>

#include "console.hpp"
#include "palpate/simulation/record.hpp"
#include "palpate/simulation/recording.hpp"
#include "palpate/simulation/scene.hpp"

namespace palpate {

struct RunOptions {
  std::filesystem::path folder;
  std::size_t every = 25;  // steps between frames; 0: none
  bool pictures = true;
  Vec3 view = Vec3(1, -1, 0.8);  // from the organ towards the eye
  Vec3 up = Vec3(0, 0, 1);
  std::string title;
  Recording* record = nullptr;        // filled
  const Recording* replay = nullptr;  // what is run in place of the motion
  std::filesystem::path replayed_file;
};

// Follows a replay: tick k's state must be the one recorded.
struct Comparison {
  const Recording* with = nullptr;
  std::uint64_t differs_at = ~std::uint64_t{0};  // first tick whose state differs
  void see(std::uint64_t k, std::span<const State> states) noexcept {
    if (with && k < differs_at && !with->agrees(k, states)) differs_at = k;
  }
  // Error(format) where one differs.
  void require_same(const std::filesystem::path& file) const;
};

RunSummary run_scene(const Scene& scene, const RunOptions& options, const Console& console);

// One line a stage: what was made, how long it took, how large it is, and the memory in use.
void stage_line(const Console& console, const std::string& name, const std::string& what, double seconds,
                std::size_t bytes);

}  // namespace palpate
