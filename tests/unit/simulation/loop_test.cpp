#include "palpate/simulation/loop.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numeric>
#include <thread>

#include "fixtures.hpp"
#include "palpate/base/error.hpp"
#include "support/refuse_threads.hpp"

namespace palpate {
namespace {

void press(std::uint64_t k, Input& input) {
  const double t = static_cast<double>(k) / 400, depth = 0.01 * std::min({1.0, 5 * t, 5 * (1 - t)}) - 0.001;
  input.instruments[0].translation = Vec3(-0.02 + 0.04 * t, 0.003, 0.1 + 0.02 - depth);
}

void expect_same_bits_as_step_by_step(bool awake) {
  const Model model = block_model(10, Sphere{0.02});
  State expected = make_state(model);
  std::vector<Vec3> forces;
  Input input = at(Vec3::Zero());
  for (std::uint64_t k = 0; k <= 400; ++k)
    press(k, input), step(model, expected, input), forces.push_back(expected.wrenches[0].force);

  State state = make_state(model);
  std::size_t frames = 0, differing = 0;
  LoopSettings settings;
  settings.frame_rate = 200, settings.awake = awake;
  LoopHooks hooks;
  hooks.input = [&](std::uint64_t k, const State&, Input& in) {
    press(k, in);
    return k <= 400;
  };
  hooks.output = [&](std::uint64_t k, const Input&, const State& s) {
    differing += s.wrenches[0].force != forces[k];
  };
  hooks.frame = [&](std::uint64_t, const Frame& f) {
    frames += f.surface.displacement.size() == model.organ.surface_size();
  };
  const LoopReport report = run_loop(model, state, settings, hooks);
  EXPECT_TRUE(!awake || !report.first_in);
  EXPECT_EQ(differing, 0u);
  EXPECT_EQ(report.ticks.wall.count(), 401u);
  EXPECT_GE(report.seconds, 0.39);  // it kept to its rate
  EXPECT_GT(frames, 0u);
  EXPECT_EQ(frames, report.frames);
  EXPECT_LE(report.frames, 200 * report.seconds + 2);
  EXPECT_GT(report.contacts_max, 5u);
  double peak = 0;
  for (const Vec3& force : forces) peak = std::max(peak, force.norm());
  EXPECT_EQ(report.peak_force, peak);
  EXPECT_EQ(state.surface.displacement, expected.surface.displacement);
  EXPECT_NE(loop_table(report).find("p99.9"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(loop_json(report))["tick_cpu"]["count"], 401);
  EXPECT_EQ(nlohmann::json::parse(loop_json(report))["awake"], awake);
}

TEST(Loop, SameBitsAsStepByStep) { expect_same_bits_as_step_by_step(false); }

// With a rate it never slept for, and no precedence: a thread that does not sleep would let nobody in.
TEST(Loop, SameBitsAsStepByStepAwake) { expect_same_bits_as_step_by_step(true); }

TEST(Loop, AsFastAsItGoesUntilTheTicksAreDone) {
  const Model model = block_model(5, Sphere{0.02});
  State state = make_state(model);
  LoopSettings settings;
  settings.rate = 0, settings.ticks = 2000, settings.idle_ticks = 100;
  LoopHooks hooks;
  hooks.input = [](std::uint64_t, const State&, Input& in) { return press(200, in), true; };
  const LoopReport report = run_loop(model, state, settings, hooks);
  EXPECT_EQ(report.ticks.wall.count(), 2000u);
  EXPECT_EQ(report.idle.wall.count(), 100u);
  EXPECT_EQ(report.ticks.missed, 0u);
}

// Tick `slow` takes so many milliseconds.
LoopReport with_a_delay(std::uint64_t ticks, std::uint64_t slow, int ms) {
  const Model model = block_model(4, Sphere{0.02});
  State state = make_state(model);
  LoopSettings settings;
  settings.ticks = ticks;
  LoopHooks hooks;
  hooks.input = [=](std::uint64_t k, const State&, Input& in) {
    if (k == slow) std::this_thread::sleep_for(std::chrono::milliseconds(ms));
    return press(0, in), true;
  };
  return run_loop(model, state, settings, hooks);
}

TEST(Loop, LateTicksAreCountedAndTheLoopGoesOn) {
  const LoopReport report = with_a_delay(100, 50, 20);
  EXPECT_GE(report.ticks.missed, 15u);  // it catches up, tick by tick
  EXPECT_GE(report.ticks.wall.worst(), 0.019);
  EXPECT_EQ(report.ticks.wall.count(), 100u);
}

// So far behind that it does not catch up: what it leaves out is missed, too.
TEST(Loop, TicksThatAreLeftOutAreMissed) {
  const LoopReport report = with_a_delay(20, 10, 250);
  EXPECT_GE(report.ticks.missed, 245u);
  EXPECT_EQ(report.ticks.wall.count(), 20u);
}

TEST(Loop, RefusesWhatItCannotDo) {
  Model model = block_model(4, Sphere{0.02});
  State state = make_state(model);
  LoopHooks hooks;
  hooks.input = [](std::uint64_t, const State&, Input&) { return false; };
  for (const double rate : {-1.0, 0.5, 4001.0, std::nan("")}) {
    LoopSettings settings;
    settings.rate = rate;
    EXPECT_THROW(run_loop(model, state, settings, hooks), Error) << rate;
  }
  EXPECT_THROW(run_loop(model, state, {}, {}), Error);  // no input()
  EXPECT_THROW(run_loop(std::span(&model, 1), std::span(&state, 1), {}, OrgansHooks{}), Error);
  model.settings.mode = Mode::imprint;
  EXPECT_THROW(run_loop(model, state, {}, hooks), Error);
}

// The system gives one thread, but not the other: an error, and nothing hangs.
TEST(Loop, SaysThatThereAreNoThreads) {
  if (!PALPATE_REFUSES_THREADS) GTEST_SKIP() << "the sanitizers have their own threads";
  const Model model = block_model(4, Sphere{0.02});
  State state = make_state(model);
  LoopHooks hooks;
  hooks.input = [](std::uint64_t, const State&, Input&) { return false; };
  for (const int given : {0, 1}) {
    threads_left = given;
    try {
      run_loop(model, state, {}, hooks);
      ADD_FAILURE() << given;
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::resource) << e.what();
    }
    EXPECT_EQ(threads_left, 0);
    threads_left = -1;
  }
  EXPECT_EQ(run_loop(model, state, {}, hooks).ticks.wall.count(), 0u);
}

TEST(Loop, FourThousandTicksASecond) {
  const Model model = block_model(4, Sphere{0.02});
  State state = make_state(model);
  LoopSettings settings;
  settings.rate = 4000, settings.ticks = 2000;
  LoopHooks hooks;
  hooks.input = [](std::uint64_t k, const State&, Input& in) { return press(k % 400, in), true; };
  const LoopReport report = run_loop(model, state, settings, hooks);
  EXPECT_EQ(report.ticks.wall.count(), 2000u);
  EXPECT_GE(report.seconds, 0.499);
  EXPECT_GT(report.contacts_max, 0u);
}

// Each status is counted where it is met; the histograms' columns hold all ticks.
TEST(Loop, CountsWhatItMeets) {
  Model model = block_model(4, Sphere{0.05});
  model.settings.max_contacts = 3;
  State state = make_state(model);
  LoopSettings settings;
  settings.rate = 0, settings.ticks = 60, settings.idle_ticks = 7;
  std::uint64_t full = 0, anchored = 0;
  LoopHooks hooks;
  hooks.input = [&](std::uint64_t k, const State&, Input& in) {
    in = at(k < 10 ? Vec3(0, 0, std::nan("")) : k < 30 ? Vec3(0, 0, 0.13) : Vec3(0.06, 0, 0.005));
    return true;
  };
  hooks.output = [&](std::uint64_t, const Input&, const State& s) {
    full += (s.status & too_many_contacts) != 0, anchored += (s.status & anchor_touched) != 0;
  };
  const LoopReport report = run_loop(model, state, settings, hooks);
  EXPECT_EQ(report.bad_input, 10u);
  EXPECT_GE(full, 20u);
  EXPECT_EQ(report.too_many_contacts, full);
  EXPECT_EQ(anchored, 30u);
  EXPECT_EQ(report.anchor_touched, anchored);
  EXPECT_EQ(report.jumped, 1u);  // from above to the base, 14 cm in a tick; the first good tick is no jump
  const std::string table = loop_table(report);
  std::istringstream rows(table.substr(table.find("ticks of up to")));
  std::string line;
  std::getline(rows, line);
  std::array<std::uint64_t, 3> sum{};
  double last = 0;
  while (std::getline(rows, line)) {
    std::istringstream row(line);
    double up_to = 0;
    std::string unit;
    std::array<std::uint64_t, 3> counts{};
    row >> up_to >> unit >> counts[0] >> counts[1] >> counts[2];
    ASSERT_TRUE(row) << line;
    EXPECT_GT(up_to, last);
    last = up_to;
    for (std::size_t c = 0; c < 3; ++c) sum[c] += counts[c];
  }
  EXPECT_EQ(sum, (std::array<std::uint64_t, 3>{60, 60, 7})) << table;
}

TEST(Loop, ItsReportHasAllKeys) {
  const Model model = block_model(4, Sphere{0.02});
  State state = make_state(model);
  LoopSettings settings;
  settings.ticks = 300, settings.idle_ticks = 100, settings.frame_rate = 200;
  LoopHooks hooks;
  hooks.input = [](std::uint64_t k, const State&, Input& in) { return press(k, in), true; };
  const auto json = nlohmann::json::parse(loop_json(run_loop(model, state, settings, hooks)));
  for (const auto& [part, count] : {std::pair{"tick_cpu", 300},
                                    {"tick_wall", 300},
                                    {"empty_tick_cpu", 100},
                                    {"empty_tick_wall", 100},
                                    {"surface", -1}}) {
    const auto& times = json.at(part);
    double last = 0;
    for (const char* key : {"p50_ms", "p99_ms", "p99.9_ms", "worst_ms"}) {
      EXPECT_GE(times.at(key).get<double>(), last) << part << ' ' << key;
      last = times.at(key);
    }
    EXPECT_GT(last, 0) << part;
    EXPECT_GT(times.at("mean_ms").get<double>(), 0) << part;
    EXPECT_LE(times.at("mean_ms").get<double>(), last) << part;
    if (count > 0) {
      EXPECT_EQ(times.at("count"), count) << part;
    } else {
      EXPECT_EQ(times.at("count"), json.at("frames"));
    }
  }
  for (const char* key :
       {"missed", "empty_missed", "frames", "contacts_max", "not_converged", "too_many_contacts", "bad_input",
        "anchor_touched", "jumped", "frames_beyond_linear"})
    EXPECT_TRUE(json.at(key).is_number_unsigned()) << key;
  for (const char* key : {"seconds", "contacts_mean", "largest_strain"})
    EXPECT_GT(json.at(key).get<double>(), 0) << key;
  EXPECT_TRUE(json.at("sched_fifo").is_boolean());
  for (const char* part : {"tick_cpu", "tick_wall", "empty_tick_cpu", "empty_tick_wall"}) {
    const auto up_to = json.at("histograms").at(part).at("up_to_ms").get<std::vector<double>>();
    const auto count = json["histograms"][part].at("count").get<std::vector<std::uint64_t>>();
    ASSERT_EQ(up_to.size(), count.size()) << part;
    EXPECT_EQ(std::accumulate(count.begin(), count.end(), std::uint64_t{0}), json[part]["count"]) << part;
    EXPECT_GT(*std::min_element(count.begin(), count.end()), 0u) << part;
    EXPECT_TRUE(std::is_sorted(up_to.begin(), up_to.end())) << part;
    EXPECT_GE(up_to.back(), json[part]["worst_ms"].get<double>()) << part;
    EXPECT_LT(up_to.back(), 1.03 * json[part]["worst_ms"].get<double>()) << part;
  }
}

}  // namespace
}  // namespace palpate
