// The force loop: what a tick costs its thread while another deforms the whole surface.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "bench.hpp"
#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/simulation/loop.hpp"
#include "scenes.hpp"

namespace palpate {

namespace {

// How deep the instrument must be to touch so many nodes; the state is then there.
double depth_of(const scenes::Press& press, State& state, std::size_t contacts) {
  for (double depth = 0; depth < 0.02;) {
    depth += 0.1e-3;
    step(press.model, state, {0, {}, {press.at(depth)}});
    if (state.contacts.size() >= contacts) return depth;
  }
  throw Error(ErrorKind::internal, "only {} contacts at 20 mm depth", state.contacts.size());
}

// To and fro along the organ, 0.1 m/s at most, at 1 kHz.
LoopReport slide(const scenes::Press& press, std::size_t contacts, std::uint64_t ticks, double frame_rate,
                 bool awake, double& depth) {
  State state = make_state(press.model);
  depth = depth_of(press, state, contacts + contacts / 30);  // some come and go
  LoopSettings settings;
  settings.ticks = ticks, settings.frame_rate = frame_rate, settings.awake = awake;
  settings.idle_ticks = std::max<std::uint64_t>(ticks / 10, 10000);
  LoopHooks hooks;
  hooks.input = [&](std::uint64_t k, const State&, Input& input) {
    input.instruments[0] = press.at(depth, 2e-3 * std::sin(0.05 * static_cast<double>(k)));
    return true;
  };
  return run_loop(press.model, state, settings, hooks);
}

std::vector<Value> percentiles(int nodes, std::size_t contacts, double friction, bool awake,
                               std::uint64_t ticks, const Value& peer) {
  scenes::Press press = scenes::press_ball(scenes::bake_kidney(nodes));
  press.model.settings.friction = friction;
  double depth = 0;
  const LoopReport r = slide(press, contacts, ticks, LoopSettings().frame_rate, awake, depth);
  std::vector<Value> out;
  for (const double p : {0.5, 0.99, 0.999})
    out.push_back(
        {1e3 * r.ticks.cpu.percentile(p), peer.peer, peer.peer_value,
         fmt::format(
             "{} ticks, {}, {:.0f} contacts, mu {}, {} not converged, worst {:.3g} ms, due to done {:.3g} "
             "ms, worst {:.3g} (empty loop {:.3g}, {:.3g}), {} missed or left out ({}), {:.0f} surfaces a "
             "second",
             r.ticks.cpu.count(), awake ? "awake" : "sleeping in between", r.contacts_mean, friction,
             r.not_converged, 1e3 * r.ticks.cpu.worst(), 1e3 * r.ticks.wall.percentile(p),
             1e3 * r.ticks.wall.worst(), 1e3 * r.idle.wall.percentile(p), 1e3 * r.idle.wall.worst(),
             r.ticks.missed, r.idle.missed, static_cast<double>(r.frames) / r.seconds)});
  return out;
}

std::vector<Value> frames(int nodes, std::size_t contacts) {
  const scenes::Press press = scenes::press_ball(scenes::bake_kidney(nodes));
  double depth = 0;
  const LoopReport r = slide(press, contacts, 10000, 240, true, depth);
  return {{static_cast<double>(r.frames) / r.seconds, "", no_peer,
           fmt::format("{:.0f} contacts, a surface in {:.3g} ms, beside {:.0f} ticks a second of {:.3g} ms, "
                       "{} of {} missed",
                       r.contacts_mean, 1e3 * r.surface.percentile(0.5),
                       static_cast<double>(r.ticks.cpu.count()) / r.seconds,
                       1e3 * r.ticks.cpu.percentile(0.5), r.ticks.missed, r.ticks.cpu.count())}};
}

// The instrument at a corner of the organ's box, where a kidney is not: nothing touches.
std::vector<Value> clear(int nodes, Storage storage) {
  scenes::Kidney kidney = scenes::pad_kidney(nodes);
  Organ organ = bake(std::move(kidney.mesh), std::move(kidney.materials), std::move(kidney.anchors), 0, {},
                     nullptr, {1, storage, 1e-3, 0, {}, {}, false});
  const Box box = bounding_box(organ.surface.vertices);
  Model model;
  model.organ = std::move(organ);
  const Shape ball = Sphere{0.01};
  model.instruments.push_back({"ball", ball, surface_of_primitive(ball)});
  State state = make_state(model);
  const auto tick_at = [&](double k) {
    tick(model, state,
         {0,
          {},
          {Pose{Eigen::Quaterniond::Identity(), box.max - Vec3(1e-3, 1e-3, 1e-3) * (1 + 0.1 * std::sin(k))}}},
         state.surface);
  };
  for (int k = 0; k < 100; ++k) tick_at(k);
  if (!state.contacts.empty()) throw Error(ErrorKind::internal, "it touches");
  const Timer timer = thread_timer();
  for (int k = 0; k < 1000; ++k) tick_at(k);
  return {{1e3 * timer.seconds(), "", no_peer, fmt::format("{} surface nodes", model.organ.surface_size())}};
}

// What a ring about the organ adds to the ticks of a ball that is dragged over it: the ring touches nothing,
// but all of the organ is in its box (T 7.2 point 2, a teapot in a stadium). Both move in every tick, the
// ring by 0.1 mm at most; surfaces are up to eight ticks old.
std::vector<Value> ring(int nodes, Storage storage) {
  scenes::Kidney kidney = scenes::pad_kidney(nodes);
  scenes::Press press =
      scenes::press_ball(bake(std::move(kidney.mesh), std::move(kidney.materials), std::move(kidney.anchors),
                              0, {}, nullptr, {1, storage, 1e-3, 0, {}, {}, false}));
  const Box box = bounding_box(press.model.organ.surface.vertices);
  const double half = 0.5 * std::hypot(box.size().x(), box.size().y());
  TriangleMesh torus = make_torus(half + 0.012, 0.01, 120, 40);
  auto lattice = std::make_shared<const Lattice>(
      sample_lattice(SignedDistanceField(torus), make_grid_spaced(bounding_box(torus.vertices), 2e-3, 4e-3)));
  double depth = 0;
  std::array<std::vector<double>, 2> ms;
  std::array<State, 2> states;
  states[0] = make_state(press.model);
  depth = depth_of(press, states[0], 110);
  Model both = press.model;
  both.instruments.push_back({"ring", std::move(lattice), std::move(torus)});
  states[1] = make_state(both);
  const Pose about{Eigen::Quaterniond::Identity(), box.center()};
  for (int k = 0; k < 100; ++k) step(both, states[1], {0, {}, {press.at(1e-2 * depth * (k + 1)), about}});
  step(press.model, states[0], {0, {}, {press.at(depth)}});
  step(both, states[1], {0, {}, {press.at(depth), about}});
  std::array<Surface, 2> surfaces{states[0].surface, states[1].surface};
  Deformer deformer(press.model.organ);
  std::vector<double> more;
  for (int k = 0; k < 4000; ++k) {
    const double way = 2e-3 * std::sin(0.05 * k);
    for (const bool second : {false, true}) {  // by turns, as the second finds what both read in the cache
      const std::size_t i = second != (k % 2 == 1);
      Input input{0, {}, {press.at(depth, way)}};
      if (i == 1) input.instruments.push_back({about.rotation, about.translation + Vec3(0, 0, 0.5 * way)});
      const Timer timer = thread_timer();
      tick(i == 0 ? press.model : both, states[i], input, surfaces[i]);
      ms[i].push_back(1e3 * timer.seconds());
      if (k % 8 == 7) deform(i == 0 ? press.model : both, states[i].loads, deformer, surfaces[i], states[i]);
    }
    more.push_back(1e3 * (ms[1].back() - ms[0].back()));
    for (const Contact& c : states[1].contacts)
      if (c.instrument == 1) throw Error(ErrorKind::internal, "the ring touches");
  }
  const double typical = median(more);
  std::sort(more.begin(), more.end());
  return {{typical, "", no_peer,
           fmt::format("beside {} contacts, whose ticks take {:.3g} ms; at 99 % of the ticks {:.3g} us",
                       states[0].contacts.size(), median(ms[0]), more[more.size() * 99 / 100])}};
}

}  // namespace

void register_loop(Bench& bench) {
  const auto rows = [](const std::string& name) {
    return std::vector<Row>{{name + ".p50", "ms"}, {name + ".p99", "ms"}, {name + ".p99.9", "ms"}};
  };
  const Value sofa{0, "SOFA precomputed, 2,744 nodes, 142 contacts, recorded", 48};
  const auto ticks = [&bench] { return bench.full() ? 1'000'000u : 100'000u; };
  bench.add(rows("loop.3000.100"), [=] { return percentiles(3000, 100, 0.3, true, ticks(), sofa); });
  bench.add(rows("loop.10000.300"), [=] { return percentiles(10000, 300, 0, true, ticks(), {}); });
  bench.add(
      rows("loop.10000.300.friction"), [=] { return percentiles(10000, 300, 0.3, true, ticks(), {}); }, true);
  bench.add(
      rows("loop.3000.100.sleeping"), [=] { return percentiles(3000, 100, 0.3, false, ticks(), sofa); },
      true);
  bench.add(
      rows("loop.10000.300.sleeping"), [=] { return percentiles(10000, 300, 0, false, ticks(), {}); }, true);
  bench.add({{"loop.frames.10000.100", "1/s", true}}, [] { return frames(10000, 100); });
  bench.add({{"loop.clear.10000", "us"}}, [] { return clear(10000, Storage::hierarchical); });
  bench.add({{"loop.ring.10000", "us"}}, [] { return ring(10000, Storage::hierarchical); });
  bench.add(
      {{"loop.ring.100000", "us"}}, [] { return ring(100000, Storage::hierarchical); }, true);
  bench.add(
      {{"loop.clear.100000", "us"}}, [] { return clear(100000, Storage::hierarchical); }, true);
}

}  // namespace palpate
