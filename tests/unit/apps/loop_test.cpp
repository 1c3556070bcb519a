// The program in real time: loop, recordings, a simulated hand.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "palpate/io/atomic_file.hpp"
#include "palpate/simulation/recording.hpp"
#include "run.hpp"
#include "unit/io/io_test.hpp"

namespace palpate {
namespace {

using nlohmann::json;

const std::string folder_of_scene = PALPATE_SOURCE_DIR "/tests/regression/";

struct LoopOfProgram : ::testing::Test {
  TempFolder folder;
  std::string in(const std::string& name) const { return fmt::format("'{}'", (folder / name).string()); }
  Ran operator()(const std::string& options) const {
    return run_palpate(fmt::format("simulate '{}scene.toml' --no-pictures --every 0 -o {} {}",
                                   folder_of_scene, in("run"), options));
  }
};

TEST_F(LoopOfProgram, PrintsPercentilesAndLeavesASummary) {
  const Ran run = (*this)("--loop --rate 2000 --ticks 3000");
  ASSERT_EQ(run.exit_code, 0) << run.output;
  for (const char* part : {"p99.9", "tick, CPU time", "empty tick", "of 3000"})
    EXPECT_NE(run.output.find(part), std::string::npos) << run.output;
  const json summary = json::parse(read_file(folder / "run/summary.json"));
  EXPECT_EQ(summary.at("rate_hz"), 2000);
  for (const auto& [part, count] : {std::pair{"tick_cpu", 3000},
                                    {"tick_wall", 3000},
                                    {"empty_tick_cpu", 3000},
                                    {"empty_tick_wall", 3000}}) {
    const json& times = summary.at("loop").at(part);
    EXPECT_EQ(times.at("count"), count);
    for (const auto& [less, more] :
         {std::pair{"p50_ms", "p99_ms"}, {"p99_ms", "p99.9_ms"}, {"p99.9_ms", "worst_ms"}})
      EXPECT_LE(times.at(less).get<double>(), times.at(more).get<double>()) << part;
  }
  for (const char* key : {"missed", "empty_missed"}) EXPECT_TRUE(summary["loop"].at(key).is_number()) << key;
  EXPECT_GE(summary["loop"]["seconds"].get<double>(), 1.49);
  EXPECT_GT(summary["loop"]["contacts_max"].get<int>(), 4);
  EXPECT_GT(summary["loop"]["peak_force_N"].get<double>(), 0.05);
  EXPECT_GT(summary["loop"]["frames"].get<int>(), 0);
}

// The same table as step by step, of the ticks that were shown.
TEST_F(LoopOfProgram, LeavesTheForcesOfItsFrames) {
  const auto table = [&] {  // without times: of each tick its other cells
    std::map<std::string, std::vector<std::string>> rows;
    std::istringstream lines(read_file(folder / "run/forces.csv"));
    for (std::string line; std::getline(lines, line);) {
      std::istringstream cells(line);
      std::vector<std::string> row;
      for (std::string cell; std::getline(cells, cell, ',');) row.push_back(cell);
      if (row.size() > 7) row.erase(row.begin() + 7);
      EXPECT_TRUE(rows.emplace(row.at(0), row).second) << line;
    }
    return rows;
  };
  const Ran steps = (*this)("");
  ASSERT_EQ(steps.exit_code, 0) << steps.output;
  const auto expected = table();
  const std::vector<std::string>& header = expected.at("step");
  EXPECT_EQ(header.at(7), "force_error");
  const Ran loop = (*this)("--loop --frame-rate 100");
  ASSERT_EQ(loop.exit_code, 0) << loop.output;
  const auto rows = table();
  const json summary = json::parse(read_file(folder / "run/summary.json"));
  EXPECT_EQ(rows.size(), 1 + summary["loop"]["frames"].get<std::size_t>());
  EXPECT_GT(rows.size(), 10u);
  double force = 0, error = 0;
  for (const auto& [tick, row] : rows) {
    EXPECT_EQ(row, expected.at(tick)) << tick;
    if (tick == "step") continue;
    error = std::max(error, std::stod(row.at(7)));
    force = std::max(force, std::abs(std::stod(row.at(10))));
  }
  EXPECT_EQ(header.at(10), "bar.fz_N");
  EXPECT_GT(force, 0.05);
  EXPECT_GT(error, 0.01);
}

TEST_F(LoopOfProgram, WhatAHandDidIsReplayedWithoutIt) {
  const Ran hand = (*this)(fmt::format("--loop --ticks 1000 --device 'loopback:{}motion.csv' --record {}",
                                       folder_of_scene, in("hand.h5")));
  ASSERT_EQ(hand.exit_code, 0) << hand.output;
  EXPECT_NE(hand.output.find("connected in 1000 of 1000 ticks"), std::string::npos) << hand.output;
  EXPECT_GT(json::parse(read_file(folder / "run/summary.json"))["device"]["peak_force_N"].get<double>(), 0.1);
  for (const char* how : {"", "--loop --rate 0"}) {
    const Ran again = (*this)(fmt::format("{} --replay {}", how, in("hand.h5")));
    EXPECT_EQ(again.exit_code, 0) << again.output;
    EXPECT_NE(again.output.find("replayed: 1000 ticks, the same states at all 2 hashes"), std::string::npos)
        << again.output;
  }
}

// Ticks that are shorter than the scene's steps, or longer: all are recorded.
TEST_F(LoopOfProgram, TheWholeMotionIsRecordedAtAnyRate) {
  folder.write("short.csv", "time,ball.z\n0.1,0.05\n0.3,0.046\n");
  for (const auto& [dt, rate, ticks] :
       {std::tuple{"1 ms", 2000, 401}, {"10 ms", 1000, 201}, {"0.1 ms", 1000, 201}}) {
    folder.write(
        "scene.toml",
        fmt::format("[organ]\nmodel = \"{0}block.h5\"\n[[instrument]]\nname = \"ball\"\nsphere = 0.02\n"
                    "[motion]\ndt = \"{1}\"\nfile = \"short.csv\"\n",
                    folder_of_scene, dt));
    const std::string scene =
        fmt::format("simulate {} --no-pictures --every 0 -o {}", in("scene.toml"), in("run"));
    const Ran run = run_palpate(fmt::format("{} --loop --rate {} --record {}", scene, rate, in("all.h5")));
    ASSERT_EQ(run.exit_code, 0) << run.output;
    const Ran again = run_palpate(fmt::format("{} --loop --rate 0 --replay {}", scene, in("all.h5")));
    EXPECT_EQ(again.exit_code, 0) << again.output;
    EXPECT_NE(again.output.find(fmt::format("replayed: {} ticks", ticks)), std::string::npos) << again.output;
  }
}

// No service, no device: its instrument waits where the motion begins; one the motion knows nothing of waits
// where it touches nothing.
TEST_F(LoopOfProgram, UntilTheDeviceIsThereTheInstrumentWaits) {
  for (const char* motion : {"time,tool.x,tool.y,tool.z\n0,0.1,0,0.2\n0.2,0,0,0\n", "time\n0\n0.2\n"}) {
    folder.write("wait.csv", motion);
    folder.write("scene.toml",
                 fmt::format("[organ]\nmodel = \"{}block.h5\"\n[[instrument]]\nname = \"tool\"\n"
                             "sphere = 0.02\n[motion]\nfile = \"wait.csv\"\n",
                             folder_of_scene));
    const Ran run = run_palpate(
        fmt::format("simulate {} --loop --rate 2000 --device haply:ws://localhost:1 -o {} --record {}",
                    in("scene.toml"), in("run"), in("wait.h5")));
    ASSERT_EQ(run.exit_code, 0) << run.output;
    const json summary = json::parse(read_file(folder / "run/summary.json"));
    EXPECT_EQ(summary["loop"]["contacts_max"], 0);
    EXPECT_EQ(summary["device"]["ticks_connected"], 0);
    EXPECT_EQ(summary["device"]["peak_force_N"], 0);
    const Recording record = Recording::read(folder / "wait.h5");
    std::vector<Input> inputs(1);
    inputs[0].instruments.resize(1);
    for (const std::uint64_t k : {std::uint64_t{0}, record.ticks() - 1}) {
      record.set_inputs(k, inputs);
      const Vec3& p = inputs[0].instruments[0].translation;
      if (std::string_view(motion).starts_with("time,")) {
        EXPECT_EQ(p, Vec3(0.1, 0, 0.2));
      } else {
        EXPECT_GT(p.norm(), 0.05);
      }
    }
  }
}

// In real time, by a hand, and again step by step.
TEST_F(LoopOfProgram, AHandBetweenTwoKidneys) {
  const std::string scenes = PALPATE_SOURCE_DIR "/scenes/";
  const auto run = [&](const std::string& options) {
    const Ran ran = run_palpate(fmt::format("simulate '{}two_kidneys.toml' --no-pictures --every 0 -o {} {}",
                                            scenes, in("run"), options));
    EXPECT_EQ(ran.exit_code, 0) << ran.output;
    return ran.output;
  };
  run(fmt::format("--loop --ticks 1000 --device 'loopback:{}two_kidneys.csv#tool' --record {}", scenes,
                  in("hand.h5")));
  EXPECT_GT(json::parse(read_file(folder / "run/summary.json"))["device"]["peak_force_N"].get<double>(), 0.1);
  const std::string again = run("--replay " + in("hand.h5"));
  EXPECT_NE(again.find("replayed: 1000 ticks, the same states at all 2 hashes"), std::string::npos) << again;
  const json summary = json::parse(read_file(folder / "run/summary.json"));
  ASSERT_EQ(summary["organs"].size(), 2u);
  EXPECT_EQ(summary["organs"][1]["name"], "right");
  EXPECT_GT(summary["organs"][0]["contacts_max"].get<int>(), 2);
  EXPECT_GT(summary["organs"][1]["contacts_max"].get<int>(), 2);
  const Ran other = (*this)("--replay " + in("hand.h5"));  // a scene of one organ
  EXPECT_NE(other.output.find("it has 2 organ(s) and 1 instrument(s), the scene 1 and 2"), std::string::npos)
      << other.output;
}

TEST_F(LoopOfProgram, SaysWhatDiffersAndWhatItCannotDo) {
  folder.write("scene.toml", fmt::format("[organ]\nmodel = \"{0}block.h5\"\n[[instrument]]\nname = \"bar\"\n"
                                         "sphere = 0.02\n[[instrument]]\nname = \"ball\"\nsphere = 0.02\n"
                                         "[motion]\nfile = \"{0}motion.csv\"\n",
                                         folder_of_scene));
  const Ran other =
      run_palpate(fmt::format("simulate {} --no-pictures --every 0 -o {} --replay '{}recording.h5'",
                              in("scene.toml"), in("run"), folder_of_scene));
  EXPECT_NE(other.exit_code, 0);
  EXPECT_NE(other.output.find("the state after tick 999 is not the one recorded"), std::string::npos)
      << other.output;
  for (const char* options :
       {"--device haply", "--loop --device mouse", "--loop --rate 5000", "--loop --frame-rate 0",
        "--replay none.h5", "--loop --rate 0 --device haply", "--awake", "--rate 500", "--frame-rate 60",
        "--ticks 10", "--loop --device-at 0 0 0"}) {
    const Ran run = (*this)(options);
    EXPECT_NE(run.exit_code, 0) << options;
    EXPECT_NE(run.output.find("palpate: "), std::string::npos) << run.output;
  }
}

}  // namespace
}  // namespace palpate
