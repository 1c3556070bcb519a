#include "palpate/contact/contact_block.hpp"

#include <gtest/gtest.h>

#include <random>

namespace palpate {
namespace {

void equals_the_compliance(std::size_t capacity, std::size_t watchable, std::size_t rows = 50) {
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
  for (int tick = 0; tick < (rows > 50 ? 60 : 500); ++tick) {
    const std::size_t among = tick % 2 ? rows : 15;
    const std::vector<Index> wanted = some(capacity, among), watched = some(2 * watchable, among);
    block.require(c, wanted);
    for (const Index row : watched)
      if (!block.is_loadable(block.slot_of(row))) {
        ASSERT_FALSE(block.is_loadable(block.watch(c, row)));
      }
    ASSERT_LE(block.used(), capacity);
    std::vector<Index> loaded;
    std::vector<Vec3> forces;
    for (const Index row : wanted) {
      ASSERT_TRUE(block.is_loadable(block.slot_of(row)));
      loaded.push_back(block.slot_of(row)), forces.push_back(Vec3::Random());
      ASSERT_EQ(block.own(loaded.back()), block.between(loaded.back(), loaded.back()));
      for (const Index other : wanted)
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            ASSERT_EQ(block.between(block.slot_of(row), block.slot_of(other))(a, b), entry(row, other, a, b));
    }
    std::vector<double> u(3 * block.plane());
    block.displacements(loaded, forces, u);
    std::vector<float> planes(3 * block.plane()), product(3 * block.plane());
    block.spread(loaded, forces, planes);
    block.add_product(planes, product);
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
        const double near = 1e-6 * 1e5 * static_cast<double>(capacity);
        ASSERT_LE((block.displacement(slot, planes) - expected).norm(), near);
        std::vector<float> its(9 * wanted.size());
        c.block({&row, 1}, wanted, its, 3 * wanted.size());
        ASSERT_LE((ContactBlock::displacement(its.data(), forces) - expected).norm(), near);
        if (!block.is_loadable(slot)) continue;
        ASSERT_LE((block.in_planes<double>(u, slot) - expected).norm(), near);
        ASSERT_LE((block.in_planes<float>(product, slot) - expected).norm(), near);
      }
    ASSERT_GE(seen, wanted.size() + std::min(watched.size(), watchable) / 2);
  }
}

// A point that rides on three nodes: B C B' for the weights B, whatever slots the nodes have.
TEST(ContactBlock, CombinesThreeNodes) {
  constexpr std::size_t rows = 20;
  HugeArray<float> matrix(9 * rows * rows);
  std::mt19937 random(7);
  for (std::size_t i = 0; i < 3 * rows; ++i)
    for (std::size_t j = 0; j <= i; ++j)
      matrix[i * 3 * rows + j] = matrix[j * 3 * rows + i] = static_cast<float>(random() % 1000);
  const Compliance c = Compliance::dense(std::move(matrix), rows);
  const auto between = [&](Index i, Index j) {
    Mat3 out;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        out(a, b) =
            static_cast<double>(c.matrix()[static_cast<std::size_t>((3 * i + a) * 3 * 20 + 3 * j + b)]);
    return out;
  };
  ContactBlock block(8, 6, rows, 2);
  const Vec3 weights[] = {Vec3(0.2, 0.3, 0.5), Vec3(0.6, 0, 0.4)};
  for (int k = 0; k < 3; ++k) {  // the slots of the nodes, and what was there before, differ
    const std::vector<Index> wanted[] = {{3, 7, 11, 4}, {11, 4, 0, 1, 2, 3, 7}, {4, 3, 5, 11, 7}};
    block.require(c, wanted[k]);
    const Vec3 force(1, 2, -3);
    std::vector<float> planes(3 * block.plane(), 1e6f);  // places between nodes do not disturb what nodes do
    const Index loaded = block.slot_of(7), watching = block.watch(c, 15);
    block.spread(std::span(&loaded, 1), std::span(&force, 1), planes);
    const Index nodes[2][3] = {{3, 7, 11}, {4, -1, 7}};  // the second has an anchored one
    Index slot[2];
    for (int p = 0; p < 2; ++p) {
      std::array<Index, 3> slots;
      for (std::size_t l = 0; l < 3; ++l) slots[l] = nodes[p][l] < 0 ? -1 : block.slot_of(nodes[p][l]);
      slot[p] = block.combine(slots, weights[p]);
    }
    EXPECT_LT((block.displacement(watching, planes) - between(15, 7) * force).norm(), 1e-3);
    EXPECT_LT((block.displacement(block.slot_of(3), planes) - between(3, 7) * force).norm(), 1e-3);
    const auto expected = [&](int p, const auto& column) {
      Mat3 sum = Mat3::Zero();
      for (int l = 0; l < 3; ++l)
        if (nodes[p][l] >= 0) sum += weights[p][l] * column(nodes[p][l]);
      return sum;
    };
    for (int p = 0; p < 2; ++p) {
      EXPECT_EQ(block.own(slot[p]), block.between(slot[p], slot[p]));
      for (const Index node : wanted[k]) {
        const Mat3 row = expected(p, [&](Index i) { return between(i, node); });
        EXPECT_LT((block.between(slot[p], block.slot_of(node)) - row).norm(), 1e-3);
        EXPECT_LT((block.between(block.slot_of(node), slot[p]) - row.transpose()).norm(), 1e-3);
      }
      for (int q = 0; q < 2; ++q)
        EXPECT_LT((block.between(slot[p], slot[q]) -
                   expected(p,
                            [&](Index i) {
                              return Mat3(expected(q, [&](Index j) { return between(j, i); }).transpose());
                            }))
                      .norm(),
                  1e-3);
      std::vector<double> u(3 * block.plane());
      block.displacements(std::span(&slot[p], 1), std::span(&force, 1), u);
      for (const Index node : {3, 7, 11})
        EXPECT_LT((block.in_planes<double>(u, block.slot_of(node)) -
                   expected(p, [&](Index i) { return between(node, i); }) * force)
                      .norm(),
                  1e-2);
    }
  }
}

TEST(ContactBlock, EqualsTheComplianceWhateverCameBefore) {
  equals_the_compliance(12, 9);
  equals_the_compliance(1, 40);
  equals_the_compliance(3, 40);  // most of all are only watched
  equals_the_compliance(50, 1);
  equals_the_compliance(150, 30, 200);  // many slots come and go
}

}  // namespace
}  // namespace palpate
