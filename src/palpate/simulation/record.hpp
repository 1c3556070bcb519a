// What a run leaves behind: frames/*.vtu with frames.pvd, forces.csv, summary.json.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "palpate/simulation/force_table.hpp"

namespace palpate {

// Of one organ over a run; or of all: contacts and the forces on each instrument are then sums.
struct ContactSummary {
  std::size_t surface_nodes = 0, not_converged = 0;  // the latter: steps
  std::size_t contacts_max = 0;
  std::size_t grasped_max = 0;                   // nodes held by grips
  double contacts_mean = 0;                      // over the steps in contact
  double deepest_before = 0, deepest_after = 0;  // m, over the run
  double peak_force = 0;                         // N
  Vec3 peak_direction = Vec3::Zero();            // unit, of the force on the instrument
  double peak_time = 0;                          // s
  ErrorBar peak_bar, largest_bar;                // at the peak force; the one with the largest total.
                                                 // Of all organs: the largest of theirs
  double largest_strain = 0;                     // principal, where the surface is touched
  std::size_t beyond_linear = 0;                 // steps with status strain_beyond_linear
  std::size_t steps_in_contact = 0;

  // What a step shows, of one organ or of all.
  void add(std::span<const Frame> frames);
};

struct RunSummary : ContactSummary {
  std::size_t steps = 0;
  std::vector<std::pair<std::string, ContactSummary>> organs;  // each with its name, where there are several
  double step_ms_median = 0, step_ms_p99 = 0, step_ms_worst = 0, steps_per_second = 0;
};

class Recorder {
 public:
  // Creates the folder. every: steps between frames written as .vtu (0: none). names: of the organs.
  Recorder(std::filesystem::path folder, std::span<const Model> models, const std::vector<std::string>& names,
           std::size_t every);
  void add(std::size_t step, std::span<const State> states);
  // One organ.
  Recorder(std::filesystem::path folder, const Model& model, std::size_t every)
      : Recorder(std::move(folder), std::span(&model, 1), {"organ"}, every) {}
  void add(std::size_t step, const State& state) { add(step, std::span(&state, 1)); }
  // Writes frames.pvd, forces.csv and summary.json; returns what summary.json says.
  RunSummary finish();

 private:
  std::filesystem::path folder_;
  std::span<const Model> models_;
  std::vector<std::vector<Index>> drawn_of_;  // of each organ: drawn vertex nearest to each surface node
  std::size_t every_;
  std::vector<double> step_ms_;
  std::vector<std::string> frames_;
  std::vector<double> frame_times_;
  ForceTable forces_;
  RunSummary summary_;
};

// The table printed at the end of a run.
std::string summary_table(const RunSummary& summary);
std::string summary_json(const RunSummary& summary);

}  // namespace palpate
