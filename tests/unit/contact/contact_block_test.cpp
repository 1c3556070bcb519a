#include "palpate/contact/contact_block.hpp"

#include <gtest/gtest.h>

#include <random>

namespace palpate {
namespace {

void equals_the_compliance(std::size_t capacity, std::size_t watchable) {
  constexpr std::size_t rows = 50;
  HugeArray<float> matrix(9 * rows * rows);
  std::mt19937 random(6);
  for (std::size_t i = 0; i < 3 * rows; ++i)
    for (std::size_t j = 0; j <= i; ++j)
      matrix[i * 3 * rows + j] = matrix[j * 3 * rows + i] = static_cast<float>(random() % 100000);
  const Compliance c = Compliance::dense(std::move(matrix), rows);
  ContactBlock block(capacity, watchable, rows);
  const auto entry = [&](Index i, Index j, int a, int b) {
    return c.matrix()[(3 * static_cast<std::size_t>(i) + static_cast<std::size_t>(a)) * 3 * rows +
                      3 * static_cast<std::size_t>(j) + static_cast<std::size_t>(b)];
  };
  const auto some = [&](std::size_t most, std::size_t among) {
    std::vector<Index> out;
    for (std::size_t k = random() % (most + 1); k > 0; --k) {
      const auto row = static_cast<Index>(random() % among);
      if (std::find(out.begin(), out.end(), row) == out.end()) out.push_back(row);
    }
    return out;
  };
  for (int tick = 0; tick < 500; ++tick) {
    const std::size_t among = tick % 2 ? rows : 15;
    const std::vector<Index> wanted = some(capacity, among), watched = some(2 * watchable, among);
    block.require(c, wanted, watched);
    ASSERT_LE(block.used(), capacity);
    std::vector<Index> loaded;
    std::vector<Vec3> forces;
    for (const Index row : wanted) {
      ASSERT_TRUE(block.is_loadable(block.slot_of(row)));
      loaded.push_back(block.slot_of(row)), forces.push_back(Vec3::Random());
      for (const Index other : wanted)
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            ASSERT_EQ(block.between(block.slot_of(row), block.slot_of(other))(a, b), entry(row, other, a, b));
    }
    std::vector<double> u(3 * block.plane());
    block.displacements(loaded, forces, u);
    std::size_t seen = 0;
    for (const std::vector<Index>* rows_of : {&wanted, &watched})
      for (const Index row : *rows_of) {
        const Index slot = block.slot_of(row);
        if (slot < 0) continue;
        ++seen;
        Vec3 expected = Vec3::Zero();
        for (std::size_t k = 0; k < loaded.size(); ++k)
          for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b)
              expected[a] += static_cast<double>(entry(row, wanted[k], a, b)) * forces[k][b];
        const Vec3 got = block.in_planes<double>(u, slot);
        ASSERT_LE((got - expected).norm(), 1e-6 * 1e5 * static_cast<double>(capacity));
        ASSERT_EQ(got, block.displacement(slot, loaded, forces));  // to the bit
        std::vector<float> its(9 * wanted.size());
        c.block({&row, 1}, wanted, its, 3 * wanted.size());
        ASSERT_EQ(got, ContactBlock::displacement(its.data(), forces));
      }
    ASSERT_GE(seen, wanted.size() + std::min(watched.size(), watchable) / 2);
  }
}

TEST(ContactBlock, EqualsTheComplianceWhateverCameBefore) {
  equals_the_compliance(12, 9);
  equals_the_compliance(3, 40);  // most of all are only watched
  equals_the_compliance(50, 1);
}

}  // namespace
}  // namespace palpate
