#include "palpate/compliance/ordering.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "palpate/base/error.hpp"
#include "palpate/compliance/symbolic.hpp"
#include "unit/compliance/systems.hpp"

namespace palpate {
namespace {

bool is_permutation(std::vector<Index> order, std::size_t n) {
  std::sort(order.begin(), order.end());
  for (std::size_t i = 0; i < order.size(); ++i)
    if (order[i] != static_cast<Index>(i)) return false;
  return order.size() == n;
}

TEST(Ordering, IsAPermutationForAnyGraph) {
  for (const Index n : {0, 1, 7, 8, 9, 50, 400})
    for (const int edges : {0, 1, 30, 2000}) {
      const Sparse a = random_system(n, n > 1 ? random_edges(n, edges, 1) : grid_edges(0, 0, 0), 1);
      EXPECT_TRUE(is_permutation(nested_dissection(a), static_cast<std::size_t>(n))) << n << ' ' << edges;
    }
}

TEST(Ordering, IsReproducibleWhateverRandSays) {
  const Sparse a = random_system(1000, grid_edges(10, 10, 10), 1);
  const std::vector<Index> order = nested_dissection(a);
  std::srand(12345);
  EXPECT_EQ(nested_dissection(a), order);
  nested_dissection(random_system(300, grid_edges(3, 10, 10), 1));
  EXPECT_EQ(nested_dissection(a), order);
}

TEST(Ordering, DissectionSavesMostOfTheWork) {
  const Sparse a = random_system(1728, grid_edges(12, 12, 12), 1);
  const NodeGraph graph = node_graph(a);
  std::vector<Index> natural(1728);
  for (std::size_t i = 0; i < natural.size(); ++i) natural[i] = static_cast<Index>(i);
  EXPECT_LT(2 * analyse(graph, nested_dissection(a)).panel_entries, analyse(graph, natural).panel_entries);
}

TEST(Ordering, GraphHasExplicitZerosAndNoDiagonal) {
  Sparse a(9, 9);
  for (int i = 0; i < 9; ++i) a.insert(i, i) = 1;
  a.insert(1, 8) = 0, a.insert(8, 1) = 0;
  const NodeGraph graph = node_graph(a);
  ASSERT_EQ(graph.nodes(), 3u);
  EXPECT_EQ(std::vector<Index>(graph.of(0).begin(), graph.of(0).end()), std::vector<Index>{2});
  EXPECT_TRUE(graph.of(1).empty());
  EXPECT_THROW(node_graph(Sparse(4, 4)), Error);
  EXPECT_THROW(node_graph(Sparse(3, 6)), Error);
}

}  // namespace
}  // namespace palpate
