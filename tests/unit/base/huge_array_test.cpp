#include "palpate/base/huge_array.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>

#include "palpate/base/error.hpp"

namespace palpate {
namespace {

TEST(HugeArray, AlignedZeroedAndMovable) {
  HugeArray<float> a(1'000'003);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(a.data()) % (2u << 20), 0u);
  for (std::size_t i = 0; i < a.size(); i += 4096) EXPECT_EQ(a[i], 0.0f);
  a[1'000'002] = 5;
  const HugeArray<float> b = std::move(a);
  EXPECT_EQ(b[1'000'002], 5.0f);
}

TEST(HugeArray, TooMuchIsANamedError) {
  EXPECT_THROW(HugeArray<char>(std::size_t{1} << 60), Error);
  EXPECT_THROW(huge_allocate(std::numeric_limits<std::size_t>::max()), Error);
}

}  // namespace
}  // namespace palpate
