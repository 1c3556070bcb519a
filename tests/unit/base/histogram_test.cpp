#include "palpate/base/histogram.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace palpate {
namespace {

TEST(Histogram, PercentilesWithinABin) {
  Histogram h;
  EXPECT_EQ(h.percentile(0.5), 0);
  std::mt19937 random(1);
  std::lognormal_distribution<double> draw(std::log(2e-4), 1);
  std::vector<double> all;
  for (int i = 0; i < 100000; ++i) all.push_back(draw(random)), h.add(all.back());
  std::sort(all.begin(), all.end());
  for (const double p : {0.001, 0.5, 0.99, 0.999, 1.0}) {
    const double exact = all[static_cast<std::size_t>(std::ceil(p * 1e5)) - 1];
    EXPECT_GE(h.percentile(p), exact * (1 - 1e-9));
    EXPECT_LE(h.percentile(p), exact * 1.03);
  }
  EXPECT_EQ(h.worst(), all.back());
  EXPECT_EQ(h.percentile(1), all.back());
}

TEST(Histogram, GivesItsBins) {
  Histogram h;
  std::vector<double> all{1e-6, 1.001e-6, 2e-4, 2e-4, 0.3};
  for (const double t : all) h.add(t);
  std::size_t seen = 0;
  double last = 0;
  h.each_bin([&](double end, std::uint64_t count) {
    EXPECT_GT(end, last);
    EXPECT_GT(count, 0u);
    last = end;
    for (; count > 0; --count, ++seen) {  // the next of all are in it
      ASSERT_LT(seen, all.size());
      EXPECT_LE(all[seen], end);
      EXPECT_GE(all[seen] * 1.03, end);
    }
  });
  EXPECT_EQ(seen, all.size());
  Histogram().each_bin([](double, std::uint64_t) { ADD_FAILURE(); });
}

TEST(Histogram, AbsurdTimesFallIntoTheLastBins) {
  Histogram h;
  for (const double t : {0.0, -1.0, 1e-12, 1e9}) h.add(t);
  EXPECT_EQ(h.count(), 4u);
  EXPECT_LE(h.percentile(0.5), 1.1e-8);
  EXPECT_EQ(h.worst(), 1e9);
}

}  // namespace
}  // namespace palpate
