#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "palpate/base/timer.hpp"
#include "run.hpp"

namespace palpate {

void run_simulate(const SimulateOptions& options, const Console& console) {
  const Timer timer = wall_timer();
  Scene scene = read_scene(options.scene, console.threads, console.progress("scene"));
  if (options.steps) scene.steps = options.steps;
  const Model& model = scene.model;
  stage_line(console, "scene",
             fmt::format("{} surface nodes, {} instrument(s), {} steps of {}", model.organ.surface_size(),
                         model.instruments.size(), scene.steps, human_time(scene.dt)),
             timer.seconds(), model.organ.compliance.bytes());
  RunOptions run;
  run.folder = options.output;
  run.every = options.every;
  run.pictures = options.pictures;
  run.title = options.scene.filename().string();
  const RunSummary summary = run_scene(scene, run, console);
  console.line(summary_table(summary) + "  left in " + options.output.string());
  console.object(nlohmann::json::parse(summary_json(summary)));
}

}  // namespace palpate
