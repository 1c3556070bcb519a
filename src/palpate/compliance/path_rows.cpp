#include "palpate/compliance/path_rows.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

PathRows place(const Factored<float>& y, std::vector<Index> branches) {
  PathRows out;
  out.branches = std::move(branches);
  for (const Index b : out.branches) {
    out.first.push_back(out.size);
    out.size += y.branches[at(b)].width;
  }
  return out;
}

}  // namespace

LeafPaths::LeafPaths(const Factored<float>& y, std::span<const Index> order)
    : y_(y), order_(order), rank_of_(y.load_at.size()), branch_of_(y.load_at.size()) {
  for (std::size_t r = 0; r < y.load_at.size(); ++r) rank_of_[at(y.load_at[r])] = static_cast<Index>(r);
  for (std::size_t b = 0; b < y.branches.size(); ++b)
    for (std::size_t r = y.branches[b].own; r < y.branches[b].end; r += 3)
      branch_of_[r / 3] = static_cast<Index>(b);
}

PathRows LeafPaths::rows(std::size_t begin, std::size_t end) const {
  std::vector<Index> branches;
  for (std::size_t p = begin; p < end; ++p)
    for (Index b = branch_of_[at(rank_of_[at(order_[p])])]; b >= 0; b = y_.branches[at(b)].parent)
      branches.push_back(b);
  std::sort(branches.begin(), branches.end(), std::greater<>());
  branches.erase(std::unique(branches.begin(), branches.end()), branches.end());
  return place(y_, std::move(branches));
}

PathRows LeafPaths::merge(const Factored<float>& y, const PathRows& a, const PathRows& b) {
  std::vector<Index> branches;
  std::set_union(a.branches.begin(), a.branches.end(), b.branches.begin(), b.branches.end(),
                 std::back_inserter(branches), std::greater<>());
  return place(y, std::move(branches));
}

PathRows LeafPaths::part(const Factored<float>& y, const PathRows& rows,
                         const std::vector<std::uint8_t>& wanted) {
  std::vector<Index> branches;
  std::copy_if(rows.branches.begin(), rows.branches.end(), std::back_inserter(branches),
               [&](Index b) { return wanted[at(b)] != 0; });
  return place(y, std::move(branches));
}

PathMatrix LeafPaths::columns(const PathRows& rows, std::size_t begin, std::size_t end) const {
  PathMatrix out(rows, 3 * (end - begin));
  // By branches, so that loads that are neighbours in Y share the cache lines read.
  std::vector<std::pair<std::size_t, std::size_t>> loads;  // rank, column
  for (std::size_t p = begin; p < end; ++p)
    loads.emplace_back(3 * at(rank_of_[at(order_[p])]), 3 * (p - begin));
  std::sort(loads.begin(), loads.end());
  for (std::size_t i = 0; i < rows.branches.size(); ++i) {
    const auto& branch = y_.branches[at(rows.branches[i])];
    for (std::size_t k = 0; k < branch.width; ++k)
      for (const auto& [rank, column] : loads) {
        if (rank < branch.begin || rank >= branch.end) continue;
        const float* y = y_.y.data() + y_.index(rank, branch.depth + k);
        float* to = out.at(rows.first[i] + k, column);
        for (std::size_t a = 0; a < 3; ++a) to[a * rows.size] = y[a];
      }
  }
  return out;
}

}  // namespace palpate
