#include "palpate/base/hash.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace palpate {
namespace {

std::uint64_t hash_of(const std::string& bytes) {
  Hash hash;
  hash.add_bytes(bytes.data(), bytes.size());
  return hash.value();
}

// The definition in the header, by hand: files written on one machine are checked on another.
TEST(Hash, IsWhatTheHeaderSays) {
  const auto step = [](std::uint64_t h, std::uint64_t w) {
    h = (h ^ w) * 0x9e3779b97f4a7c15u;
    return h ^ (h >> 32);
  };
  const std::uint64_t start = 0xcbf29ce484222325u;
  EXPECT_EQ(hash_of(""), step(start, 0));
  EXPECT_EQ(hash_of("abcdefghi"), step(step(step(start, 0x6867666564636261u), 0x69), 9));
}

TEST(Hash, DependsOnBytesNotOnCalls) {
  const std::string text = "the quick brown fox jumps over the lazy dog";
  for (std::size_t a = 0; a <= text.size(); ++a)
    for (std::size_t b = a; b <= text.size(); ++b) {
      Hash hash;
      hash.add_bytes(text.data(), a);
      hash.add_bytes(text.data() + a, b - a);
      hash.add_bytes(text.data() + b, text.size() - b);
      ASSERT_EQ(hash.value(), hash_of(text)) << a << " " << b;
    }
}

TEST(Hash, SeesEveryFlippedBitAndPairsOfSigns) {
  std::string bytes(64, '\x5a');
  const std::uint64_t whole = hash_of(bytes);
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    bytes[bit / 8] ^= static_cast<char>(1 << bit % 8);
    EXPECT_NE(hash_of(bytes), whole) << bit;
    bytes[bit / 8] ^= static_cast<char>(1 << bit % 8);
  }
  const std::vector<double> a{1, 2, 3}, b{-1, -2, 3};
  Hash x, y;
  x.add(std::span(a)), y.add(std::span(b));
  EXPECT_NE(x.value(), y.value());
  EXPECT_NE(hash_of(std::string(8, '\0')), hash_of(std::string(9, '\0')));
}

}  // namespace
}  // namespace palpate
