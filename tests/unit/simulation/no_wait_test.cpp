// Nothing in the force loop throws, and nothing waits for another thread.
#include <gtest/gtest.h>

#include <mutex>

#include "fixtures.hpp"
#include "palpate/base/triple_buffer.hpp"
#include "palpate/contact/solver.hpp"
#include "palpate/simulation/loop.hpp"
#include "palpate/simulation/recording.hpp"
#include "support/count_locks.hpp"

namespace palpate {
namespace {

template <class T>
T& of() noexcept;  // declval, named as a thing

static_assert(noexcept(tick(of<const Model>(), of<State>(), of<const Input>(), of<const Surface>())));
static_assert(noexcept(step(of<const Model>(), of<State>(), of<const Input>())));
static_assert(noexcept(step(std::span<const Model>(), std::span<State>(), std::span<const Input>())));
static_assert(noexcept(place(std::span<Input>(), 0, of<const Pose>())));
static_assert(noexcept(grip(std::span<Input>(), 0, true)));
static_assert(noexcept(wrench_of(std::span<const State>(), 0)));
static_assert(noexcept(of<Deformer>()(of<const Organ>(), of<const Loads>(), of<Surface>())));
static_assert(noexcept(deform(of<const Model>(), of<const Loads>(), of<Deformer>(), of<Surface>(),
                              of<Outcome>())));
static_assert(noexcept(of<Loads>().copy(of<const Loads>())));
static_assert(noexcept(of<ContactSolver>().solve(of<const ContactBlock>(), {}, {}, 0, of<SolverLimits>())));
static_assert(noexcept(of<ContactSolver>().prescribed(of<const ContactBlock>(), {}, {}, of<SolverLimits>())));
static_assert(noexcept(of<ContactBlock>().require(of<const Compliance>(), {})));
static_assert(noexcept(of<TripleBuffer<std::vector<Loads>>>().publish()));
static_assert(noexcept(of<TripleBuffer<std::vector<Loads>>>().fetch()));
static_assert(noexcept(of<TripleBuffer<std::vector<Loads>>>().back()));
static_assert(noexcept(of<TripleBuffer<std::vector<Loads>>>().front()));
static_assert(noexcept(of<Recording>().add(std::span<const Input>(), std::span<const State>())));
static_assert(std::atomic<std::uint8_t>::is_always_lock_free);  // of the triple buffer

// The force thread takes no lock between its first and its last tick, nor does the surface's; with friction,
// a grip, a place between nodes, two organs, a hierarchical compliance.
TEST(Loop, TakesNoLock) {
  if (!PALPATE_COUNTS_LOCKS) GTEST_SKIP() << "the sanitizers have their own locks";
  std::vector<Model> models;
  models.push_back(block_model(8, Sphere{0.03}));
  models[0].settings.friction = 0.3;
  models[0].instruments.push_back({"needle", Capsule{0.5e-3, 0.03}, {}});
  models.push_back(models[0]);
  models[1].organ = block_organ(8, {1, Storage::hierarchical, 1e-3, 0});
  for (const bool with_a_lock : {true, false}) {  // it does count
    std::vector<State> states = make_states(models);
    Recording recording(models, 200);
    std::mutex mutex;
    std::size_t first = 0, last = 0, frame_first = 0, frame_last = 0, frames = 0, touched = 0, held = 0,
                places = 0;
    LoopSettings settings;
    settings.frame_rate = 500, settings.ticks = 200;
    OrgansHooks hooks;
    hooks.input = [&](std::uint64_t k, std::span<const State> now, std::span<Input> inputs) {
      (k == 0 ? first : last) = thread_locks;
      if (k == 100 && with_a_lock) std::lock_guard{mutex};
      const double t = static_cast<double>(k);
      inputs[0].organ.translation.x() = -0.07, inputs[1].organ.translation.x() = 0.07;
      place(inputs, 0, {Eigen::Quaterniond::Identity(), Vec3(0.002, 0, 0.131 - 0.0001 * t)});
      place(inputs, 1, {Eigen::Quaterniond::Identity(), Vec3(-0.071, 0.017, 0.131 - 0.00005 * t)});
      grip(inputs, 0, k > 120 && k < 180);
      for (const State& s : now) {
        touched += !s.contacts.empty(), held += !s.grasps.empty();
        for (const Contact& c : s.contacts) places += c.triangle >= 0;
      }
      return true;
    };
    hooks.output = [&](std::uint64_t, std::span<const Input> inputs, std::span<const State> now) {
      recording.add(inputs, now);
    };
    hooks.frame = [&](std::uint64_t, std::span<const Frame>) {
      if (frames++ == 0) frame_first = thread_locks;
      frame_last = thread_locks;
    };
    run_loop(models, states, settings, hooks);
    EXPECT_EQ(last - first, with_a_lock ? 1u : 0u);
    EXPECT_EQ(frame_last, frame_first);
    EXPECT_GT(frames, 1u);
    EXPECT_GT(touched, 200u);
    EXPECT_GT(held, 20u);
    EXPECT_GT(places, 20u);
  }
}

}  // namespace
}  // namespace palpate
