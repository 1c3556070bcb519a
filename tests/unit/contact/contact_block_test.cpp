#include "palpate/contact/contact_block.hpp"

#include <gtest/gtest.h>

#include <random>

namespace palpate {
namespace {

TEST(ContactBlock, EqualsTheComplianceWhateverCameBefore) {
  constexpr std::size_t rows = 50, capacity = 12;
  HugeArray<float> matrix(9 * rows * rows);
  std::mt19937 random(6);
  for (std::size_t i = 0; i < 3 * rows; ++i)
    for (std::size_t j = 0; j <= i; ++j)
      matrix[i * 3 * rows + j] = matrix[j * 3 * rows + i] = static_cast<float>(random() % 100000);
  const Compliance c = Compliance::dense(std::move(matrix), rows);
  ContactBlock block(capacity, rows);
  for (int tick = 0; tick < 300; ++tick) {
    std::vector<Index> wanted;
    for (std::size_t k = random() % (capacity + 1); k > 0; --k) {
      const auto row = static_cast<Index>(random() % (tick % 2 ? rows : 15));
      if (std::find(wanted.begin(), wanted.end(), row) == wanted.end()) wanted.push_back(row);
    }
    std::vector<Index> slots(wanted.size());
    block.require(c, wanted, slots);
    ASSERT_LE(block.used(), capacity);
    for (std::size_t i = 0; i < wanted.size(); ++i)
      for (std::size_t j = 0; j < wanted.size(); ++j)
        for (std::size_t a = 0; a < 3; ++a)
          for (std::size_t b = 0; b < 3; ++b)
            ASSERT_EQ(block.at(slots[i], slots[j])[a * block.ld() + b],
                      c.matrix()[(3 * static_cast<std::size_t>(wanted[i]) + a) * 3 * rows +
                                 3 * static_cast<std::size_t>(wanted[j]) + b]);
  }
}

}  // namespace
}  // namespace palpate
