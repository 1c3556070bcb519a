// What a run leaves behind: frames/*.vtu with frames.pvd, forces.csv, summary.json.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "palpate/simulation/model.hpp"

namespace palpate {

struct RunSummary {
  std::size_t steps = 0, surface_nodes = 0, not_converged = 0;
  std::size_t contacts_max = 0;
  double contacts_mean = 0;                      // over the steps in contact
  double deepest_before = 0, deepest_after = 0;  // m, over the run
  double peak_force = 0;                         // N
  Vec3 peak_direction = Vec3::Zero();            // unit, of the force on the instrument
  double peak_time = 0;                          // s
  double step_ms_median = 0, step_ms_p99 = 0, step_ms_worst = 0, steps_per_second = 0;
};

class Recorder {
 public:
  // Creates the folder. every: steps between frames written as .vtu (0: none).
  Recorder(std::filesystem::path folder, const Model& model, std::size_t every);
  void add(std::size_t step, const Input& input, const State& state);
  // Writes frames.pvd, forces.csv and summary.json; returns what summary.json says.
  RunSummary finish();

 private:
  std::filesystem::path folder_;
  const Model& model_;
  std::vector<Index> drawn_of_;  // drawn vertex nearest to each surface node
  std::size_t every_;
  std::vector<double> step_ms_;
  std::vector<std::string> frames_;
  std::vector<double> frame_times_;
  std::string forces_;
  RunSummary summary_;
  double contact_steps_ = 0;
};

// The table printed at the end of a run.
std::string summary_table(const RunSummary& summary);
std::string summary_json(const RunSummary& summary);

}  // namespace palpate
