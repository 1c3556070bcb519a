// The step allocates nothing, whatever happens in it: contact begins, slides, ends, inputs are bad.
#include <gtest/gtest.h>

#include <thread>

#include "fixtures.hpp"
#include "palpate/simulation/loop.hpp"
#include "palpate/simulation/recording.hpp"
#include "support/count_allocations.hpp"

namespace palpate {
namespace {

TEST(Step, AllocatesNothing) {
  if (!PALPATE_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizers have their own malloc";
  const std::size_t before = allocations;
  void* volatile block = std::malloc(8);
  std::free(block);
  ASSERT_GT(allocations, before);  // it does count
  const TriangleMesh torus = make_torus(0.03, 0.012, 40, 20);
  for (const Storage storage : all_storages) {
    Model model;
    // Quadratic with one storage: the other tetrahedra, and their projection.
    model.organ = block_organ(8, {storage == Storage::half ? 2 : 1, storage, 1e-3, 0});
    for (const Mode mode : {Mode::unilateral, Mode::prescribed, Mode::gaussian, Mode::imprint})
      for (const Shape& shape : {Shape{Sphere{0.03}}, lattice_of(torus, 2e-3), Shape{Capsule{2e-3, 0.03}}}) {
        model.instruments = {{"tool", shape, surface_of_primitive(shape)}};
        model.settings.mode = mode;
        std::vector<Input> inputs;
        for (int k = 0; k < 40; ++k) {
          const double depth = 0.010 * std::min({1.0, k / 10.0, (39 - k) / 10.0}) - 0.001;
          inputs.push_back(at(Vec3(-0.02 + 0.001 * k, 0.003, 0.1 + half_height(shape) - depth)));
        }
        inputs.push_back(at(Vec3(0, 0, std::nan(""))));
        inputs.push_back({});
        for (int k = 0; k < 30; ++k) {  // a grip closes, lifts, opens
          inputs.push_back(at(Vec3(0, 0, 0.09 + half_height(shape) + 0.001 * std::max(0, k - 5))));
          inputs.back().grips = {k < 25};
        }
        inputs.push_back(at(Vec3(0, 0, 0.11)));  // a jump deep into it
        State state = make_state(model);
        std::size_t most = 0, grasped = 0, allocated = 0;
        // A thread of its own, as the force loop has: what others have allocated for themselves is no help.
        std::jthread([&] {
          const std::size_t start = allocations;
          for (const Input& input : inputs) {
            step(model, state, input);
            most = std::max(most, state.contacts.size());
            grasped = std::max(grasped, state.grasps.size());
          }
          allocated = allocations - start;
        }).join();
        EXPECT_EQ(allocated, 0u) << name(mode) << ' ' << storage_name(storage);
        const bool needle = std::holds_alternative<Capsule>(shape);  // between nodes
        EXPECT_GT(most, needle ? 0u : 3u) << name(mode) << ' ' << storage_name(storage);
        EXPECT_EQ(grasped > (needle ? 0u : 2u), mode == Mode::unilateral) << storage_name(storage);
      }
  }
}

// The force loop's thread: from its first tick on, and its surface's thread likewise.
TEST(Loop, AllocatesNothing) {
  if (!PALPATE_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizers have their own malloc";
  for (const int order : {1, 2}) {
    const Model model = block_model(8, Sphere{0.03}, Mode::unilateral, order);
    State state = make_state(model);
    std::size_t at_first = 0, at_last = 0, most = 0, frame_first = 0, frame_last = 0;
    LoopSettings settings;
    settings.frame_rate = 500;
    LoopHooks hooks;
    hooks.input = [&](std::uint64_t k, const State& s, Input& input) {
      (k == 0 ? at_first : at_last) = thread_allocations;
      most = std::max(most, s.contacts.size());
      const double t = static_cast<double>(k) / 300;
      input.instruments[0].translation = k == 150
                                             ? Vec3(0, 0, std::nan(""))
                                             : Vec3(0.04 * t - 0.02, 0, 0.141 - 0.012 * std::min(1.0, 5 * t));
      return k < 300;
    };
    hooks.frame = [&](std::uint64_t, const Frame&) {
      if (frame_first == 0) frame_first = thread_allocations;
      frame_last = thread_allocations;
    };
    run_loop(model, state, settings, hooks);
    EXPECT_EQ(at_last, at_first) << order;
    EXPECT_EQ(frame_last, frame_first) << order;
    EXPECT_GT(most, 1u);
  }
}

// With all that a tick may meet: friction, a needle between nodes, grips that close and open, compliances
// that have to work for each number.
TEST(Loop, AllocatesNothingWhateverItMeets) {
  if (!PALPATE_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizers have their own malloc";
  for (const Storage storage : {Storage::dense, Storage::half, Storage::hierarchical}) {
    Model model = block_model(8, Sphere{0.02});
    model.organ = block_organ(8, {storage == Storage::half ? 2 : 1, storage, 1e-3, 0});
    model.instruments.push_back({"needle", Capsule{0.5e-3, 0.03}, {}});
    model.settings.friction = 0.3;
    State state = make_state(model);
    std::size_t first = 0, last = 0, frame_first = 0, frame_last = 0, frames = 0;
    std::size_t held = 0, places = 0, rubbed = 0;
    LoopSettings settings;
    settings.rate = 2000, settings.frame_rate = 500, settings.ticks = 400;
    LoopHooks hooks;
    hooks.input = [&](std::uint64_t k, const State& s, Input& input) {
      (k == 0 ? first : last) = thread_allocations;
      held += !s.grasps.empty();
      for (const Contact& c : s.contacts) {
        places += c.triangle >= 0;
        rubbed += c.triangle < 0 && c.instrument == 0 && std::abs(c.force.y()) > 1e-4;
      }
      const double t = static_cast<double>(k) / 400, depth = 0.008 * std::min({1.0, 5 * t, 5 * (1 - t)});
      input.instruments[0].translation = Vec3(-0.02, -0.01 + 0.02 * t, 0.121 - depth);
      input.instruments[1].translation = Vec3(0.023 + 0.01 * t, 0.017, 0.1315 - 0.5 * depth);
      input.grips = {k > 150 && k<250, k> 200 && k < 220};
      return true;
    };
    hooks.frame = [&](std::uint64_t, const Frame&) {
      if (frames++ == 0) frame_first = thread_allocations;
      frame_last = thread_allocations;
    };
    run_loop(model, state, settings, hooks);
    EXPECT_EQ(last, first) << storage_name(storage);
    EXPECT_EQ(frame_last, frame_first) << storage_name(storage);
    EXPECT_GT(frames, 1u);
    EXPECT_GT(held, 50u);
    EXPECT_GT(places, 50u);
    EXPECT_GT(rubbed, 50u);
  }
}

// From nothing touched to all that can be, in one tick, and back; a frame's reader asks all its error bars.
TEST(Loop, AllocatesNothingWhenAllIsTouched) {
  if (!PALPATE_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizers have their own malloc";
  for (const Mode mode : {Mode::unilateral, Mode::prescribed, Mode::gaussian})
    for (const Storage storage : {Storage::dense, Storage::hierarchical}) {
      Model model = block_model(8, HalfSpace{}, mode);
      model.organ = block_organ(8, {1, storage, 1e-3, 0});
      model.settings.gaussian_radius = 0.1;
      model.instruments.push_back(model.instruments[0]);
      State state = make_state(model);
      std::size_t first = 0, last = 0, most = 0, frame_first = 0, frame_last = 0, frames = 0, shown = 0;
      double bars = 0;
      LoopSettings settings;
      settings.frame_rate = 500, settings.ticks = 200;
      LoopHooks hooks;
      hooks.input = [&](std::uint64_t k, const State& s, Input& input) {
        (k == 0 ? first : last) = thread_allocations;
        most = std::max(most, s.contacts.size());
        const bool touches = k > 60 && k < 140;
        for (Pose& pose : input.instruments)  // upside down, its solid above
          pose = {Eigen::Quaterniond(0, 1, 0, 0), Vec3(0, 0, touches ? 0.095 : 9)};
        return true;
      };
      hooks.frame = [&](std::uint64_t, const Frame& frame) {
        if (frames++ == 0) frame_first = thread_allocations;
        for (const Contact& c : frame.outcome.contacts) bars += error_bar(model.organ, frame, c).total();
        shown = std::max(shown, frame.outcome.contacts.size());
        frame_last = thread_allocations;
      };
      run_loop(model, state, settings, hooks);
      EXPECT_EQ(last, first) << name(mode) << ' ' << storage_name(storage);
      EXPECT_EQ(frame_last, frame_first) << name(mode) << ' ' << storage_name(storage);
      EXPECT_GE(most, 81u) << name(mode);
      EXPECT_EQ(shown, most) << name(mode);
      EXPECT_GT(bars, 0);
    }
}

// Two organs, a recording, and what a haptic device does with the sum of the wrenches.
TEST(Loop, AllocatesNothingWithTwoOrgans) {
  if (!PALPATE_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizers have their own malloc";
  std::vector<Model> models;
  models.push_back(block_model(8, Sphere{0.03}));
  models.push_back(block_model(6, Sphere{0.03}, Mode::unilateral, 2));
  std::vector<State> states = make_states(models);
  Recording recording(models, 200);
  std::size_t first = 0, last = 0, frame_first = 0, frame_last = 0, both = 0, frames = 0;
  Vec3 felt = Vec3::Zero();
  LoopSettings settings;
  settings.frame_rate = 500, settings.ticks = 200;
  OrgansHooks hooks;
  hooks.input = [&](std::uint64_t k, std::span<const State> now, std::span<Input> inputs) {
    (k == 0 ? first : last) = thread_allocations;
    both += !now[0].contacts.empty() && !now[1].contacts.empty();
    felt += wrench_of(now, 0).force;
    inputs[0].organ.translation.x() = -0.07, inputs[1].organ.translation.x() = 0.07;
    place(inputs, 0,
          {Eigen::Quaterniond::Identity(), Vec3(0.002, 0, 0.15 - 0.0005 * static_cast<double>(k))});
    return true;
  };
  hooks.output = [&](std::uint64_t, std::span<const Input> inputs, std::span<const State> now) {
    recording.add(inputs, now);
  };
  hooks.frame = [&](std::uint64_t, std::span<const Frame>) {
    if (frames++ == 0) frame_first = thread_allocations;
    frame_last = thread_allocations;
  };
  run_loop(models, states, settings, hooks);
  EXPECT_EQ(last, first);
  EXPECT_EQ(frame_last, frame_first);
  EXPECT_GT(frames, 1u);
  EXPECT_GT(felt.norm(), 0);
  EXPECT_GT(both, 20u);
  EXPECT_EQ(recording.ticks(), 200u);
}

}  // namespace
}  // namespace palpate
