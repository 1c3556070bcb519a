#include "palpate/simulation/recording.hpp"

#include <gtest/gtest.h>

#include "fixtures.hpp"
#include "palpate/base/error.hpp"
#include "unit/io/io_test.hpp"

namespace palpate {
namespace {

// A record that is cut short is none.
TEST(Recording, WhatDidNotFitIsAnError) {
  const Model model = block_model(2, Sphere{0.02});
  State state = make_state(model);
  const TempFolder temp;
  const Input input = at(Vec3(0, 0, 0.2));
  for (const std::uint64_t ticks : {3u, 4u, 6u}) {
    Recording recording(model, ticks);
    for (std::uint64_t k = 0; k < 4; ++k) {
      step(model, state, input);
      EXPECT_EQ(recording.add(input, state), k < ticks);
    }
    EXPECT_EQ(recording.ticks(), std::min<std::uint64_t>(ticks, 4));
    const std::filesystem::path path = temp / fmt::format("{}.h5", ticks);
    if (ticks >= 4) {
      recording.write(path, "test");
      EXPECT_EQ(Recording::read(path).ticks(), 4u);
      continue;
    }
    try {
      recording.write(path, "test");
      ADD_FAILURE();
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find("1 of 4 ticks"), std::string::npos) << e.what();
    }
    EXPECT_FALSE(std::filesystem::exists(path));
  }
}

// Other instruments than it was made for are not recorded either.
TEST(Recording, TicksOfAnotherModelAreAnError) {
  const Model model = block_model(2, Sphere{0.02});
  State state = make_state(model);
  Recording recording(model, 3);
  Input input = at(Vec3(0, 0, 0.2));
  step(model, state, input);
  EXPECT_TRUE(recording.add(input, state));
  input.instruments.push_back({});
  EXPECT_FALSE(recording.add(input, state));
  EXPECT_THROW(recording.write(TempFolder() / "x.h5", "test"), Error);
}

}  // namespace
}  // namespace palpate
