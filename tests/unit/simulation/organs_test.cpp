// Several organs under the same instruments: each is to the bit what it is alone, and the instruments feel
// the sum.
#include "palpate/simulation/organs.hpp"

#include <gtest/gtest.h>

#include "fixtures.hpp"
#include "palpate/base/error.hpp"
#include "palpate/simulation/loop.hpp"
#include "palpate/simulation/recording.hpp"
#include "unit/io/io_test.hpp"

namespace palpate {
namespace {

// Two cubes of 10 cm, a ball of 2 cm radius in the gap between them, led along it.
struct Organs : ::testing::Test {
  static constexpr std::uint64_t ticks = 300;
  std::vector<Model> models = two();
  std::vector<Input> inputs = make_inputs(models);

  static std::vector<Model> two() {
    std::vector<Model> out;
    out.push_back(block_model(8, Sphere{0.02}));
    out.push_back(block_model(6, Sphere{0.02}, Mode::unilateral, 2));
    return out;
  }
  // gap: between the cubes, m.
  static void set(std::uint64_t k, std::span<Input> inputs, double gap) {
    const double t = static_cast<double>(k) / ticks;
    for (std::size_t o = 0; o < inputs.size(); ++o)
      inputs[o].organ.translation.x() = (o == 0 ? -1 : 1) * (0.05 + 0.5 * gap);
    place(inputs, 0, {Eigen::Quaterniond::Identity(), Vec3(0, 0.04 * t - 0.02, 0.14 - 0.08 * t)});
  }
};

TEST_F(Organs, EachIsWhatItIsAlone) {
  std::vector<State> states = make_states(models);
  State alone[2] = {make_state(models[0]), make_state(models[1])};
  std::size_t both = 0;
  for (std::uint64_t k = 0; k < ticks; ++k) {
    set(k, inputs, 0.030);
    step(models, states, inputs);
    for (std::size_t o = 0; o < 2; ++o) {
      step(models[o], alone[o], inputs[o]);
      ASSERT_EQ(state_hash(states[o]), state_hash(alone[o])) << k;
    }
    const Wrench sum = wrench_of(states, 0);
    EXPECT_EQ(sum.force, alone[0].wrenches[0].force + alone[1].wrenches[0].force);
    EXPECT_EQ(sum.torque, alone[0].wrenches[0].torque + alone[1].wrenches[0].torque);
    if (states[0].contacts.empty() || states[1].contacts.empty()) continue;
    ++both;
    // They press from both sides, so that most of the force cancels.
    EXPECT_GT(states[0].wrenches[0].force.x(), 0);
    EXPECT_LT(states[1].wrenches[0].force.x(), 0);
    EXPECT_LT(std::abs(sum.force.x()),
              std::max(states[0].wrenches[0].force.x(), -states[1].wrenches[0].force.x()));
  }
  EXPECT_GT(both, 50u);
  for (std::size_t o = 0; o < 2; ++o)
    EXPECT_EQ(states[o].surface.displacement, alone[o].surface.displacement);
}

TEST_F(Organs, OneFarAwayIsNotFelt) {
  std::vector<State> states = make_states(models);
  State alone = make_state(models[0]);
  std::size_t touched = 0;
  for (std::uint64_t k = 0; k < ticks; ++k) {
    set(k, inputs, 0.030);
    inputs[1].organ.translation.x() = 10;
    step(models, states, inputs);
    step(models[0], alone, inputs[0]);
    touched += !alone.contacts.empty();
    ASSERT_EQ(wrench_of(states, 0).force, alone.wrenches[0].force);
    ASSERT_TRUE(states[1].contacts.empty());
  }
  EXPECT_GT(touched, 50u);
}

TEST_F(Organs, OverlappingOnesDoNotDisturbEachOther) {
  std::vector<State> states = make_states(models);
  for (std::uint64_t k = 0; k < ticks; ++k) {
    set(k, inputs, -0.05);
    step(models, states, inputs);
    for (const State& s : states) ASSERT_EQ(s.status & bad_input, 0u);
  }
  EXPECT_TRUE(wrench_of(states, 0).force.allFinite());
}

TEST_F(Organs, LoopIsStepByStep) {
  std::vector<State> expected = make_states(models), states = make_states(models);
  Recording recording(models, ticks);
  for (std::uint64_t k = 0; k < ticks; ++k) {
    set(k, inputs, 0.030);
    step(models, expected, inputs);
    EXPECT_TRUE(recording.add(inputs, expected));
  }
  const TempFolder folder;
  recording.write(folder / "two.h5", "test");
  const Recording back = Recording::read(folder / "two.h5");
  EXPECT_EQ(back.organs(), 2u);
  EXPECT_TRUE(back.made_with(models));
  EXPECT_FALSE(back.made_with(std::span(models).first(1)));
  std::vector<Model> other = two();
  std::swap(other[0], other[1]);
  EXPECT_FALSE(back.made_with(other));

  Recording again(models, ticks);
  std::uint64_t differing = 0, shown = 0;
  bool moved[2] = {false, false}, together = true;
  LoopSettings settings;
  settings.frame_rate = 200, settings.ticks = ticks;
  OrgansHooks hooks;
  hooks.input = [&](std::uint64_t k, std::span<const State>, std::span<Input> in) {
    return back.set_inputs(k, in), true;
  };
  hooks.output = [&](std::uint64_t k, std::span<const Input> in, std::span<const State> s) {
    differing += !back.agrees(k, s);
    again.add(in, s);
  };
  hooks.frame = [&](std::uint64_t, std::span<const Frame> frames) {
    for (std::size_t o = 0; o < 2; ++o) {
      const Surface& surface = frames[o].surface;
      shown += surface.displacement.size() == models[o].organ.surface_size();
      moved[o] = moved[o] || surface.loads.count > 0;
      together = together && surface.loads.number == frames[0].surface.loads.number;
    }
  };
  const LoopReport report = run_loop(models, states, settings, hooks);
  EXPECT_EQ(differing, 0u);
  EXPECT_EQ(state_hash(states), state_hash(expected));
  EXPECT_EQ(again.ticks(), ticks);
  EXPECT_EQ(shown, 2 * report.frames);
  EXPECT_GT(shown, 2u);
  EXPECT_TRUE(moved[0] && moved[1] && together);
  EXPECT_GT(report.contacts_max, std::max(expected[0].contacts.size(), expected[1].contacts.size()));
  for (std::size_t o = 0; o < 2; ++o)
    EXPECT_EQ(states[o].surface.displacement, expected[o].surface.displacement);
}

TEST_F(Organs, OneBitOfOnePoseOfTheSecondOrganIsSeen) {
  std::vector<State> states = make_states(models);
  Recording recording(models, 1);
  set(250, inputs, 0.030);
  step(models, states, inputs);
  ASSERT_FALSE(states[1].contacts.empty());
  recording.add(inputs, states);
  EXPECT_TRUE(recording.agrees(0, states));
  inputs[1].organ.translation.x() += 1e-9;
  step(models, states, inputs);
  EXPECT_FALSE(recording.agrees(0, states));
}

TEST_F(Organs, RefusesWhatDoesNotFit) {
  EXPECT_THROW(make_states({}), Error);
  models[1].instruments[0].name = "other";
  EXPECT_THROW(make_states(models), Error);
  models[1].instruments.clear();
  EXPECT_THROW(make_states(models), Error);
}

}  // namespace
}  // namespace palpate
