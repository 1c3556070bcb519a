// The step online, and the demo's offline stages.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

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
  const Medians m = in_turn([&] { keep(scenes::bake_kidney(nodes, 1)); });
  return {{m.ours, "", no_peer, fmt::format("{} surface nodes", nodes)}};
}

}  // namespace

void register_step(Bench& bench) {
  bench.add({{"step.3000.100", "ms"}}, [] {
    return slide(scenes::press_ball(scenes::bake_kidney(3000)), 100,
                 {0, "SOFA precomputed, 2,744 nodes, 142 contacts, recorded", 48});
  });
  // A sharp edge on a coarse lattice: the hard case.
  bench.add({{"step.3000.100.edge", "ms"}}, [] {
    return slide(scenes::press_bishop(scenes::bake_kidney(3000), 20000, Mode::unilateral), 100, {});
  });
  bench.add({{"demo.offline.600", "s"}}, [] { return offline(600); });
  bench.add({{"demo.offline.3000", "s"}}, [] { return offline(3000); });
}

}  // namespace palpate
