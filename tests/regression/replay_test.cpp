// Three recordings and the model they were made with, kept here (scene.toml; scene_rough.toml: friction, a
// grip, places between nodes; scene_lattice.toml: a lattice, made on the way): the same bits on every
// machine, with and without threads. The model was made by
//   palpate precompute BLOCK -o block.h5 --material 10e3,0.45 --anchor "half-space 0 0 0.001 0 0 1"
// and the recordings, here, by
//   for s in "" _rough _lattice; do palpate simulate scene$s.toml -o OUT --record recording$s.h5; done
// A change that means to alter forces makes them anew.
#include <gtest/gtest.h>

#include <algorithm>

#include "palpate/base/error.hpp"
#include "palpate/simulation/loop.hpp"
#include "palpate/simulation/recording.hpp"
#include "palpate/simulation/scene.hpp"
#include "unit/io/io_test.hpp"

namespace palpate {
namespace {

const std::filesystem::path folder = std::filesystem::path(PALPATE_SOURCE_DIR) / "tests/regression";

struct Replay : ::testing::Test {
  std::string name;
  Scene scene = read_scene(folder / ("scene" + name + ".toml"));
  const Model& model = scene.models[0];
  Recording recording = Recording::read(folder / ("recording" + name + ".h5"));
  State state = make_state(model);
  Input input = input_at(scene.motion, 0);
  explicit Replay(std::string which = "") : name(std::move(which)) {}

  // First tick that differs; the number of ticks where none does.
  template <class Change>
  std::uint64_t first_difference(const Change& change) {
    for (std::uint64_t k = 0; k < recording.ticks(); ++k) {
      recording.set_input(k, input);
      change(k);
      step(model, state, input);
      if (!recording.agrees(k, state)) return k;
    }
    return recording.ticks();
  }

  bool touches_between_nodes() const {
    return std::any_of(state.contacts.begin(), state.contacts.end(),
                       [](const Contact& c) { return c.triangle >= 0; });
  }

  void replay_in_the_force_loop() {
    for (const double rate : {0.0, 2000.0}) {
      State own = make_state(model);
      Recording again(model, recording.ticks());
      std::uint64_t differing = 0;
      LoopSettings settings;
      settings.rate = rate, settings.ticks = recording.ticks(), settings.frame_rate = 300;
      LoopHooks hooks;
      hooks.input = [&](std::uint64_t k, const State&, Input& in) {
        return recording.set_input(k, in), true;
      };
      hooks.output = [&](std::uint64_t k, const Input& in, const State& s) {
        differing += !recording.agrees(k, s);
        again.add(in, s);
      };
      run_loop(model, own, settings, hooks);
      EXPECT_EQ(differing, 0u) << rate;
      const TempFolder temp;
      again.write(temp / "again.h5", "palpate simulate scene.toml");
      const Recording back = Recording::read(temp / "again.h5");
      EXPECT_EQ(back.ticks(), recording.ticks());
      EXPECT_EQ(back.hashes(), recording.hashes());
      EXPECT_TRUE(back.agrees(recording.ticks() - 1, own));
    }
  }
};
struct ReplayRough : Replay {
  ReplayRough() : Replay("_rough") {}
};

struct ReplayLattice : Replay {
  ReplayLattice() : Replay("_lattice") {}
};

TEST_F(Replay, StepByStep) {
  EXPECT_EQ(recording.organ(), model.organ.hash);
  EXPECT_EQ(recording.ticks(), 1051u);
  EXPECT_EQ(first_difference([](std::uint64_t) {}), recording.ticks());
  EXPECT_EQ(state.contacts.size(), 6u);  // the hashes are of ticks that touch
}

TEST_F(Replay, OneBitOfOnePoseIsSeen) {
  EXPECT_EQ(first_difference([&](std::uint64_t k) {
              double& z = input.instruments[1].translation.z();
              if (k == 999) z = std::nextafter(z, 1.0);
            }),
            999u);
}

TEST_F(Replay, InTheForceLoop) { replay_in_the_force_loop(); }
TEST_F(ReplayRough, InTheForceLoop) { replay_in_the_force_loop(); }
TEST_F(ReplayLattice, InTheForceLoop) { replay_in_the_force_loop(); }

TEST_F(ReplayLattice, StepByStep) {
  EXPECT_EQ(recording.ticks(), 301u);
  int between = 0;  // ticks
  EXPECT_EQ(first_difference([&](std::uint64_t) { between += touches_between_nodes(); }), recording.ticks());
  EXPECT_GT(between, 200);
  EXPECT_GE(state.contacts.size(), 2u);
}

TEST_F(ReplayRough, StepByStep) {
  int closed = 0, opened = 0, between = 0;  // ticks
  const auto look = [&](std::uint64_t) {
    closed += state.grasps.empty() && input.grips[0], opened += !state.grasps.empty() && !input.grips[0];
    between += touches_between_nodes();
  };
  EXPECT_EQ(recording.ticks(), 301u);
  EXPECT_EQ(first_difference(look), recording.ticks());
  EXPECT_EQ(closed, 2);
  EXPECT_EQ(opened, 1);
  EXPECT_GT(between, 200);
}

// Its only hash is that of the last tick: what tissue went through before is in it.
TEST_F(ReplayRough, ANanometreIsSeen) {
  for (const std::uint64_t tick : {50, 90, 170, 230})
    for (const std::size_t i : {0, 1}) {
      state = make_state(model);
      EXPECT_EQ(first_difference([&](std::uint64_t k) {
                  if (k == tick) input.instruments[i].translation.x() += 1e-9;
                }),
                recording.ticks() - 1)
          << tick << ' ' << i;
    }
}

TEST_F(Replay, KeepsToItsRoom) {
  Recording small(model, 3);
  for (int k = 0; k < 5; ++k) EXPECT_EQ(small.add(input, state), k < 3);
  EXPECT_EQ(small.ticks(), 3u);
  Input other;
  EXPECT_FALSE(Recording(model, 3).add(other, state));
  EXPECT_THROW(Recording::read(folder / "block.h5"), Error);
  EXPECT_THROW(Recording::read(folder / "none.h5"), Error);
}

}  // namespace
}  // namespace palpate
