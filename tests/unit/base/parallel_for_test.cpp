#include "palpate/base/parallel_for.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace palpate {
namespace {

TEST(ParallelFor, EveryItemOnceForAnyThreads) {
  for (const int threads : {0, 1, 2, 7}) {
    std::vector<int> hits(1003, 0);
    parallel_for(hits.size(), 10, threads, [&](std::size_t b, std::size_t e) {
      EXPECT_EQ(b % 10, 0u);
      for (std::size_t i = b; i < e; ++i) ++hits[i];
    });
    for (const int h : hits) EXPECT_EQ(h, 1);
  }
  parallel_for(0, 10, 4, [](std::size_t, std::size_t) { FAIL(); });
}

TEST(ParallelFor, ExceptionReachesTheCaller) {
  EXPECT_THROW(parallel_for(100, 1, 4,
                            [](std::size_t b, std::size_t) {
                              if (b == 37) throw std::runtime_error("37");
                            }),
               std::runtime_error);
}

}  // namespace
}  // namespace palpate
