#include "palpate/haptics/watchdog.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace palpate {
namespace {

TEST(Watchdog, RampsUpAndDown) {
  Watchdog watchdog(0.02, 0.05);
  const auto at = [&](int ms) { return watchdog.scale(1e-3 * ms); };
  for (int ms = 0; ms < 100; ++ms) EXPECT_EQ(at(ms), 0);  // no tick yet
  for (int ms = 100; ms < 200; ++ms) {
    watchdog.tick(1e-3 * ms);
    EXPECT_NEAR(at(ms), std::min(1.0, (ms - 99) / 50.0), 1e-9);
  }
  for (int ms = 200; ms < 300; ++ms)  // the last tick was at 199 ms
    EXPECT_NEAR(at(ms), std::clamp(1 - (ms - 219) / 50.0, 0.0, 1.0), 1e-9) << ms;
  watchdog.tick(0.4);
  EXPECT_EQ(at(400), 1);  // whoever asks rarely gets the ramp of the time between
}

TEST(Watchdog, ClockThatStandsOrGoesBack) {
  Watchdog watchdog;
  watchdog.tick(1);
  EXPECT_EQ(watchdog.scale(1), 0);
  EXPECT_EQ(watchdog.scale(1), 0);
  EXPECT_EQ(watchdog.scale(0.5), 0);
}

TEST(Watchdog, TwoThreads) {
  Watchdog watchdog(1, 1);
  std::jthread loop([&] {
    for (int i = 0; i < 10000; ++i) watchdog.tick(1e-3 * i);
  });
  for (int i = 0; i < 10000; ++i) {
    const double scale = watchdog.scale(1e-3 * i);
    ASSERT_TRUE(scale >= 0 && scale <= 1);
  }
}

}  // namespace
}  // namespace palpate
