// The step online, and the demo's offline stages.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "bench.hpp"
#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "scenes.hpp"

namespace palpate {

namespace {

// The instrument slides to and fro along the kidney, 0.1 mm a step, pressed in so far that at least
// `contacts` nodes are touched in every step. CPU time of the stepping thread.
std::vector<Value> slide(const scenes::Press& press, std::size_t contacts, const Value& peer) {
  State state = make_state(press.model);
  const auto tick = [&](double depth, double along) {
    const Input input{0, {}, {press.at(depth, along)}};
    const Timer timer = thread_timer();
    step(press.model, state, input);
    return timer.seconds();
  };
  double depth = 0;
  while (state.contacts.size() < contacts + contacts / 10) {
    if (depth > 0.02)
      throw Error(ErrorKind::internal, "only {} contacts at 20 mm depth", state.contacts.size());
    tick(depth += 0.1e-3, 0);
  }
  std::vector<double> ms;
  std::size_t least = state.contacts.size(), most = 0;
  std::uint32_t status = 0;
  for (int i = 0; i < 1200; ++i) {
    ms.push_back(1e3 * tick(depth, 2e-3 * std::sin(0.05 * i)));
    least = std::min(least, state.contacts.size());
    most = std::max(most, state.contacts.size());
    status |= state.status;
  }
  std::sort(ms.begin(), ms.end());
  return {{median(ms), peer.peer, peer.peer_value,
           fmt::format("{} surface nodes, {} to {} contacts, {:.1f} mm deep, p99 {:.2f} ms, status {}",
                       press.model.organ.surface_size(), least, most, 1e3 * depth, ms[ms.size() * 99 / 100],
                       status)}};
}

std::vector<Value> offline(int nodes) {
  const Medians m = in_turn([&] { keep(scenes::bake_kidney(nodes, 2, 1)); });
  return {{m.ours, "", no_peer, fmt::format("{} surface nodes", nodes)}};
}

// What ./demo prints at its end: its whole motion, wall time, every step with what it touches.
std::vector<Value> demo() {
  const std::filesystem::path program =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / "palpate";
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "palpate-bench-demo";
  FILE* pipe = popen(
      fmt::format("'{}' demo --json --no-pictures -o '{}'", program.string(), folder.string()).c_str(), "r");
  if (!pipe) throw Error(ErrorKind::resource, "{}: cannot be started", program.string());
  std::string text;
  for (char buffer[4096]; const std::size_t n = std::fread(buffer, 1, sizeof buffer, pipe);)
    text.append(buffer, n);
  const int result = pclose(pipe);
  std::filesystem::remove_all(folder);
  if (result != 0) throw Error(ErrorKind::internal, "{} demo: failed", program.string());
  const auto summary = nlohmann::json::parse(text);
  return {{summary.at("steps_per_second").get<double>(), "", no_peer,
           fmt::format("p99 {:.2f} ms, up to {} contacts", summary.at("step_ms_p99").get<double>(),
                       summary.at("contacts_max").get<int>())}};
}

}  // namespace

void register_step(Bench& bench) {
  bench.add({{"step.3000.100", "ms"}}, [] {
    return slide(scenes::press_ball(scenes::bake_kidney(3000)), 100,
                 {0, "SOFA precomputed, 2,744 nodes, 142 contacts, recorded", 48});
  });
  bench.add({{"step.3000.100.p2", "ms"}},
            [] { return slide(scenes::press_ball(scenes::bake_kidney(3000, 2)), 100, {}); });
  // A sharp edge on a coarse lattice: the hard case.
  bench.add({{"step.3000.100.edge", "ms"}}, [] {
    return slide(scenes::press_bishop(scenes::bake_kidney(3000), 20000, Mode::unilateral), 100, {});
  });
  bench.add({{"demo.offline.600", "s"}}, [] { return offline(600); });
  bench.add({{"demo.offline.3000", "s"}}, [] { return offline(3000); });
  bench.add({{"demo.steps_per_second", "1/s", true}}, demo);
}

}  // namespace palpate
