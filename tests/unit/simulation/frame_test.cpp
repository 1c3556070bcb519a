// What a frame shows is of one moment, in the loop and step by step.
#include "palpate/simulation/frame.hpp"

#include <gtest/gtest.h>

#include "fixtures.hpp"
#include "palpate/simulation/loop.hpp"

namespace palpate {
namespace {

// A frame's values, kept: of an organ.
struct Kept {
  std::uint64_t k;
  Outcome outcome;
  Surface surface;
  ErrorBar bar;
};

bool same(const Pose& a, const Pose& b) {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

// Every bit of what the loop showed of tick k against a state step by step.
void expect_same(const Kept& frame, const Outcome& outcome, const Loads& loads, const ErrorBar& bar) {
  SCOPED_TRACE(frame.k);
  const Outcome& shown = frame.outcome;
  EXPECT_EQ(shown.time, outcome.time);
  EXPECT_TRUE(same(shown.organ, outcome.organ));
  ASSERT_EQ(shown.instruments.size(), outcome.instruments.size());
  for (std::size_t i = 0; i < shown.instruments.size(); ++i) {
    EXPECT_TRUE(same(shown.instruments[i], outcome.instruments[i]));
    EXPECT_EQ(shown.wrenches[i].force, outcome.wrenches[i].force);
    EXPECT_EQ(shown.wrenches[i].torque, outcome.wrenches[i].torque);
  }
  ASSERT_EQ(shown.contacts.size(), outcome.contacts.size());
  for (std::size_t i = 0; i < shown.contacts.size(); ++i) {
    EXPECT_EQ(shown.contacts[i].node, outcome.contacts[i].node);
    EXPECT_EQ(shown.contacts[i].force, outcome.contacts[i].force);
    EXPECT_EQ(shown.contacts[i].point, outcome.contacts[i].point);
  }
  EXPECT_EQ(shown.deepest_before, outcome.deepest_before);
  EXPECT_EQ(shown.deepest_after, outcome.deepest_after);
  EXPECT_EQ(shown.relinearisations, outcome.relinearisations);
  EXPECT_EQ(shown.status, outcome.status);
  const Loads& under = frame.surface.loads;
  EXPECT_EQ(under.number, loads.number);
  ASSERT_EQ(under.count, loads.count);
  for (std::size_t i = 0; i < loads.count; ++i) {
    EXPECT_EQ(under.rows[i], loads.rows[i]);
    EXPECT_EQ(under.forces[i], loads.forces[i]);
  }
  EXPECT_EQ(frame.bar.total(), bar.total());
}

// Whatever the frame's tick: its parts belong together.
void expect_consistent(const Outcome& outcome, const Surface& surface) {
  std::vector<Wrench> left = outcome.wrenches;
  double size = 0;
  Vec3 sum = Vec3::Zero();
  for (const Contact& c : outcome.contacts) {
    Wrench& wrench = left[static_cast<std::size_t>(c.instrument)];
    wrench.force += c.force;
    wrench.torque +=
        (c.point - outcome.instruments[static_cast<std::size_t>(c.instrument)].translation).cross(c.force);
    size += c.force.norm(), sum += c.force_in_organ;
  }
  for (const Wrench& wrench : left) {
    EXPECT_LE(wrench.force.norm(), 1e-12 * size);
    EXPECT_LE(wrench.torque.norm(), 1e-12 * size);
  }
  for (std::size_t i = 0; i < surface.loads.count; ++i) sum -= surface.loads.forces[i];
  EXPECT_LE(sum.norm(), 1e-12 * size);
  EXPECT_EQ((outcome.status & strain_beyond_linear) != 0, surface.strains.beyond_linear());
}

Pose turned(double angle, const Vec3& at) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, Vec3(1, 2, 3).normalized())), at};
}

constexpr std::uint64_t ticks = 400;

// Two balls go in and out, the second half as deep, the organs move and turn with them.
void press(std::uint64_t k, std::span<Input> inputs) {
  const double t = static_cast<double>(k) / ticks, depth = 0.01 * std::min({1.0, 4 * t, 4 * (1 - t)}) - 0.001;
  for (std::size_t o = 0; o < inputs.size(); ++o) {
    inputs[o].time = 0.25 * static_cast<double>(k);
    inputs[o].organ = turned(0.3 * t, Vec3(0.1 * t, 0, -0.001 * static_cast<double>(o)));
  }
  place(inputs, 0, inputs[0].organ * turned(t, Vec3(-0.02 + 0.01 * t, 0.003, 0.12 - depth)));
  place(inputs, 1, inputs[0].organ * turned(-t, Vec3(0.025, 0.01 * t, 0.12 - 0.5 * depth)));
}

std::vector<Model> two_organs() {
  std::vector<Model> models;
  models.push_back(block_model(10, Sphere{0.02}));
  models.push_back(block_model(8, Sphere{0.02}, Mode::unilateral, 2));
  for (Model& model : models) {
    model.settings.friction = 0.3;
    model.instruments.push_back(model.instruments[0]);
    model.instruments[1].name = "other";
  }
  return models;
}

// How deep nodes and places would be at rest: a needle that leans, between nodes, and a ball.
TEST(Frame, DepthsAreOfTheSurfaceAtRest) {
  Model model = block_model(10, Sphere{0.02});
  const Capsule needle{0.5e-3, 20e-3};
  model.instruments.push_back({"needle", needle, {}, 0});
  State state = make_state(model);
  std::size_t nodes = 0, places = 0;
  for (int k = 0; k < 40; ++k) {
    const double depth = 0.1e-3 * k;
    Input input{0, turned(0.2, Vec3(0.01, 0.02, 0.03)), {}};
    input.instruments = {input.organ * Pose{Eigen::Quaterniond::Identity(), Vec3(-0.02, 0.003, 0.12 - depth)},
                         input.organ * turned(0.3, Vec3(0.0312, 0.0117, 0.1203 - depth))};
    step(model, state, input);
    double deepest = 0;
    for (const Contact& c : state.contacts) {
      Vec3 rest = model.organ.contact_points[static_cast<std::size_t>(c.node)];
      if (c.triangle >= 0) {
        rest.setZero(), ++places;
        for (std::size_t n = 0; n < 3; ++n)
          rest += c.weights[static_cast<int>(n)] *
                  model.organ.contact_points[static_cast<std::size_t>(
                      model.organ.surface.triangles[static_cast<std::size_t>(c.triangle)][n])];
      } else {
        ++nodes;
      }
      const auto instrument = static_cast<std::size_t>(c.instrument);
      const Vec3 there = input.instruments[instrument].inverse() * (input.organ * rest);
      EXPECT_NEAR(c.gap_before, distance(model.instruments[instrument].shape, there), 1e-12);
      deepest = std::max(deepest, -c.gap_before);
    }
    EXPECT_EQ(state.deepest_before, deepest);
  }
  EXPECT_GT(nodes, 40u);
  EXPECT_GT(places, 10u);
  EXPECT_GT(state.deepest_before, 1e-3);
}

TEST(Frame, InTheLoopItIsOfOneTick) {
  const std::vector<Model> all = two_organs();
  for (const std::size_t organs : {1, 2}) {
    const std::span<const Model> models(all.data(), organs);
    std::vector<State> states = make_states(models);
    std::vector<std::vector<Kept>> kept(organs);
    LoopSettings settings;
    settings.frame_rate = 200, settings.ticks = ticks;
    OrgansHooks hooks;
    hooks.input = [](std::uint64_t k, std::span<const State>, std::span<Input> inputs) {
      return press(k, inputs), true;
    };
    hooks.frame = [&](std::uint64_t k, std::span<const Frame> frames) {
      EXPECT_EQ(frames.size(), organs);
      for (std::size_t o = 0; o < organs; ++o)
        kept[o].push_back({k, frames[o].outcome, frames[o].surface, frames[o].bar});
    };
    const LoopReport report = run_loop(models, states, settings, hooks);

    std::vector<State> expected = make_states(models);
    std::vector<Input> inputs = make_inputs(models);
    std::size_t at = 0, touching = 0, strained = 0;
    for (std::uint64_t k = 0; k < ticks; ++k) {
      press(k, inputs);
      step(models, expected, inputs);
      if (at == kept[0].size() || kept[0][at].k != k) continue;  // so numbers ascend, or some is not reached
      for (std::size_t o = 0; o < organs; ++o) {
        const Kept& frame = kept[o][at];
        EXPECT_EQ(frame.outcome.time, inputs[o].time);
        expect_same(frame, expected[o], expected[o].loads, frame_of(models[o], expected[o]).bar);
        expect_consistent(frame.outcome, frame.surface);
        EXPECT_EQ(frame.surface.displacement, expected[o].surface.displacement);
        if (frame.outcome.contacts.empty()) continue;
        ++touching, strained += (frame.outcome.status & strain_beyond_linear) != 0;
        EXPECT_GT(frame.bar.resolution, 0);
        EXPECT_GT(frame.bar.compression, 0);
        EXPECT_GT(frame.bar.linearity, 0);
        EXPECT_GT(frame.outcome.times.deform, 0);
        EXPECT_GT(frame.outcome.times.total, frame.outcome.times.deform);
      }
      ++at;
    }
    EXPECT_EQ(at, report.frames);
    EXPECT_GT(strained, 2u);
    EXPECT_GT(touching, strained);
    for (std::size_t o = 0; o < organs; ++o) {  // and the states are as after a step
      EXPECT_EQ(states[o].status, expected[o].status);
      EXPECT_EQ(states[o].surface.displacement, expected[o].surface.displacement);
    }
  }
}

// A tick that was skipped shows what there was before, poses and all.
TEST(Frame, OfABadInputItIsTheLastGoodOne) {
  const Model model = block_model(8, Sphere{0.02});
  State state = make_state(model);
  std::vector<Kept> kept;
  LoopSettings settings;
  settings.frame_rate = 200, settings.ticks = 200;
  LoopHooks hooks;
  hooks.input = [](std::uint64_t k, const State&, Input& input) {
    input = at(Vec3(0, 0, k < 100 ? 0.115 : std::nan("")));
    return true;
  };
  hooks.frame = [&](std::uint64_t k, const Frame& f) { kept.push_back({k, f.outcome, f.surface, f.bar}); };
  const LoopReport report = run_loop(model, state, settings, hooks);
  EXPECT_EQ(report.bad_input, 100u);
  std::size_t bad = 0;
  for (const Kept& frame : kept) {
    EXPECT_EQ((frame.outcome.status & bad_input) != 0, frame.k >= 100);
    bad += frame.k >= 100;
    EXPECT_FALSE(frame.outcome.contacts.empty());
    EXPECT_EQ(frame.outcome.instruments[0].translation, Vec3(0, 0, 0.115));
    expect_consistent(frame.outcome, frame.surface);
  }
  EXPECT_GT(bad, 2u);
}

TEST(Frame, AContactHasABarOfItsOwn) {
  Model model = block_model(10, Sphere{0.02});
  model.instruments.push_back({"needle", Capsule{0.5e-3, 0.03}, {}});
  State state = make_state(model);
  Input input = at(Vec3(-0.02, 0, 0.114));
  input.instruments.push_back({Eigen::Quaterniond::Identity(), Vec3(0.023, 0.017, 0.129)});
  step(model, state, input);
  const Frame frame = frame_of(model, state);
  std::size_t nodes = 0, places = 0;
  double force = 0, linearity = 0, least = 1, most = 0;
  for (const Contact& c : frame.outcome.contacts) {
    const ErrorBar bar = error_bar(model.organ, frame, c);
    (c.triangle < 0 ? nodes : places) += 1;
    EXPECT_EQ(bar.discretisation, frame.bar.discretisation);
    EXPECT_EQ(bar.resolution, frame.bar.resolution);
    EXPECT_EQ(bar.compression, frame.bar.compression);
    force += c.force.norm(), linearity += c.force.norm() * bar.linearity;
    least = std::min(least, bar.linearity), most = std::max(most, bar.linearity);
  }
  EXPECT_GT(nodes, 4u);
  EXPECT_GT(places, 0u);
  EXPECT_LT(least, 0.9 * most);
  // The resultant's is their mean by force; here no node is touched by both.
  EXPECT_NEAR(linearity, force * frame.bar.linearity, 1e-9 * force);
}

TEST(Frame, OfSeveralOrgansAnInstrumentFeelsTheSum) {
  const std::vector<Model> models = two_organs();
  std::vector<State> states = make_states(models);
  std::vector<Input> inputs = make_inputs(models);
  press(150, inputs);
  step(models, states, inputs);
  const std::vector<Frame> frames = frames_of(models, states);
  for (std::size_t i = 0; i < 2; ++i) {
    const Wrench sum = wrench_of(frames, i);
    EXPECT_EQ(sum.force, states[0].wrenches[i].force + states[1].wrenches[i].force);
    EXPECT_EQ(sum.torque, states[0].wrenches[i].torque + states[1].wrenches[i].torque);
  }
  EXPECT_NE(frames[0].bar.total(), frames[1].bar.total());
  for (const std::vector<Frame>& order : {frames, std::vector<Frame>(frames.rbegin(), frames.rend())})
    EXPECT_EQ(largest_bar(order).total(), std::max(frames[0].bar.total(), frames[1].bar.total()));
}

// Laws without a solver say where their forces act, too.
TEST(Frame, EveryContactHasAPlace) {
  for (const Mode mode : {Mode::prescribed, Mode::gaussian, Mode::imprint}) {
    const Model model = block_model(8, Sphere{0.02}, mode);
    State state = make_state(model);
    Input input = at(Vec3(0.503, 0.001, 0.114));
    input.organ.translation.x() = 0.5;
    step(model, state, input);
    expect_consistent(state, state.surface);
    ASSERT_FALSE(state.contacts.empty()) << name(mode);
    for (const Contact& c : state.contacts) {
      EXPECT_NEAR(c.point.x(), 0.5, 0.035) << name(mode);
      EXPECT_NEAR(c.point.z(), 0.1, 0.015) << name(mode);
    }
  }
}

}  // namespace
}  // namespace palpate
