#include "palpate/base/triple_buffer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <thread>
#include <vector>

namespace palpate {
namespace {

TEST(TripleBuffer, GivesTheNewest) {
  TripleBuffer<int> buffer(7);
  EXPECT_EQ(buffer.front(), 7);
  EXPECT_FALSE(buffer.fetch());
  for (int i = 0; i < 5; ++i) buffer.back() = i, buffer.publish();
  EXPECT_EQ(buffer.front(), 7);  // until fetched
  EXPECT_TRUE(buffer.fetch());
  EXPECT_EQ(buffer.front(), 4);
  EXPECT_FALSE(buffer.fetch());
  EXPECT_EQ(buffer.front(), 4);
}

TEST(TripleBuffer, KeepsTheMemoryItBeganWith) {
  TripleBuffer<std::vector<int>> buffer(std::vector<int>(100));
  for (int i = 0; i < 9; ++i) {
    EXPECT_EQ(buffer.back().size(), 100u);
    buffer.publish();
    if (i % 2) buffer.fetch();
    EXPECT_EQ(buffer.front().size(), 100u);
  }
}

// Values are whole, never older than the one before, and the last one arrives.
TEST(TripleBuffer, BetweenThreads) {
  using Value = std::array<std::uint64_t, 40>;  // more than one instruction writes
  constexpr std::uint64_t last = 200000;
  TripleBuffer<Value> buffer;
  std::jthread writer([&] {
    for (std::uint64_t i = 1; i <= last; ++i) {
      buffer.back().fill(i);
      buffer.publish();
    }
  });
  std::uint64_t seen = 0;
  while (seen < last) {
    if (!buffer.fetch()) {
      std::this_thread::yield();
      continue;
    }
    const Value& value = buffer.front();
    ASSERT_GT(value[0], seen);
    seen = value[0];
    for (const std::uint64_t v : value) ASSERT_EQ(v, seen);
  }
}

}  // namespace
}  // namespace palpate
