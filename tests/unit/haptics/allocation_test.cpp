// What the force loop calls of a device allocates nothing.
#include <gtest/gtest.h>

#include <thread>

#include "loop.hpp"
#include "motion_file.hpp"
#include "palpate/haptics/watchdog.hpp"
#include "support/count_allocations.hpp"

namespace palpate {
namespace {

template <class T>
T& of() noexcept;  // declval, named as a thing

static_assert(noexcept(couple(of<const CouplingSettings>(), of<CouplingState>(), of<const DeviceSample>(),
                              of<const Wrench>(), 0)));
static_assert(noexcept(hand_wrench(of<const CouplingSettings>(), of<const CouplingState>(),
                                   of<const Wrench>())));
static_assert(noexcept(of<HapticDevice>().read()));
static_assert(noexcept(of<HapticDevice>().write(of<const Wrench>())));
static_assert(noexcept(of<Watchdog>().tick(0)));
static_assert(noexcept(of<Watchdog>().scale(0)));

TEST(Haptics, TheLoopAllocatesNothing) {
  if (!PALPATE_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizers have their own malloc";
  const std::size_t before = thread_allocations;
  void* volatile block = std::malloc(8);
  std::free(block);
  ASSERT_GT(thread_allocations, before);  // it does count
  const MotionText file(
      "time,hand.z,hand.qw,hand.qx,hand.grip\n0,0.115,1,0,0\n0.1,0.105,1,0.2,1\n0.2,0.115,1,0,1\n0.21,0.115,"
      "1,0,0\n");
  for (const std::string& driver : {file.device("replay"), file.device("loopback"), std::string("haply")}) {
    const auto device = open_device(driver);
    ForceLoop loop(block_model(4, Sphere{0.01}));
    std::size_t allocated = 0;
    double most = 0;
    std::jthread([&] {
      const std::size_t start = thread_allocations;  // haply's own thread may
      for (int i = 0; i < 300; ++i) most = std::max(most, loop.tick(*device).force.norm());
      allocated = thread_allocations - start;
    }).join();
    EXPECT_EQ(allocated, 0u) << driver;
    if (driver != "haply") {
      EXPECT_GT(most, 0.05) << driver;
    }
  }
}

}  // namespace
}  // namespace palpate
