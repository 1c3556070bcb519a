#include <algorithm>

#include "palpate/base/error.hpp"
#include "palpate/compliance/rows.hpp"
#include "palpate/compliance/storage.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

struct WorkSpace final : ComplianceWork {
  explicit WorkSpace(std::size_t size = 0) : memory(size) {}
  std::vector<float> memory;
};

WorkSpace& threads_own() {
  static thread_local WorkSpace own;
  return own;
}

std::vector<float>& work_space(ComplianceWork* given, std::size_t size) {
  auto* work = dynamic_cast<WorkSpace*>(given);
  if (!work) work = &threads_own();
  if (work->memory.size() < size) work->memory.resize(size);
  return work->memory;
}

}  // namespace

FactoredCompliance::FactoredCompliance(Factored<float> factored) : y_(std::move(factored)) {
  rank_of_.resize(nodes()), branch_of_.resize(nodes());
  for (std::size_t r = 0; r < nodes(); ++r) rank_of_[at(y_.load_at[r])] = static_cast<Index>(r);
  for (std::size_t b = 0; b < y_.branches.size(); ++b) {
    const auto& branch = y_.branches[b];
    row_of_.push_back(rows_);
    rows_ += branch.width;
    for (std::size_t r = branch.own; r < branch.end; r += 3) branch_of_[r / 3] = static_cast<Index>(b);
  }
}

std::unique_ptr<ComplianceWork> FactoredCompliance::make_work() const {
  return std::make_unique<WorkSpace>(rows_ + 3 * nodes());
}

// t = Y f on the contacts' paths, then u = Y^T t branch by branch.
void FactoredCompliance::apply(std::span<const Index> contacts, std::span<const float> forces,
                               std::span<float> u, ComplianceWork* given) const noexcept {
  std::vector<float>& work = work_space(given, rows_ + 3 * nodes());
  float *t = work.data(), *ranked = t + rows_;
  std::fill_n(t, rows_ + 3 * nodes(), 0.0f);
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    const std::size_t rank = 3 * at(rank_of_[at(contacts[c])]);
    const float* f = forces.data() + 3 * c;
    for (Index b = branch_of_[rank / 3]; b >= 0; b = y_.branches[at(b)].parent) {
      const auto& branch = y_.branches[at(b)];
      for (std::size_t k = 0; k < branch.width; ++k) {
        const float* y = y_.y.data() + y_.index(rank, branch.depth + k);
        t[row_of_[at(b)] + k] += y[0] * f[0] + y[1] * f[1] + y[2] * f[2];
      }
    }
  }
  for (std::size_t b = 0; b < y_.branches.size(); ++b) {
    const auto& branch = y_.branches[b];
    const float* weights = t + row_of_[b];
    if (std::all_of(weights, weights + branch.width, [](float w) { return w == 0; })) continue;
    constexpr std::size_t panel = Factored<float>::panel_rows;
    for (std::size_t r = branch.begin; r < branch.end;) {
      const std::size_t end = std::min(branch.end, (r / panel + 1) * panel);
      for (std::size_t k = 0; k < branch.width; k += rows_at_once) {
        const float* rows[rows_at_once];
        const std::size_t count = std::min(rows_at_once, branch.width - k);
        for (std::size_t i = 0; i < count; ++i) rows[i] = y_.y.data() + y_.index(r, branch.depth + k + i);
        add_rows(rows, weights + k, count, end - r, ranked + r);
      }
      r = end;
    }
  }
  for (std::size_t r = 0; r < nodes(); ++r) std::copy_n(ranked + 3 * r, 3, u.data() + 3 * at(y_.load_at[r]));
}

void FactoredCompliance::block(std::span<const Index> rows, std::span<const Index> columns,
                               std::span<float> out, std::size_t ld, ComplianceWork*) const noexcept {
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t j = 0; j < columns.size(); ++j) {
      const std::size_t ri = at(rank_of_[at(rows[i])]), rj = at(rank_of_[at(columns[j])]);
      // The paths are common from the front where they meet upwards.
      Index a = branch_of_[ri], b = branch_of_[rj];
      while (a != b && a >= 0 && b >= 0) (a < b ? a : b) = y_.branches[at(a < b ? a : b)].parent;
      const std::size_t common = a == b && a >= 0 ? y_.branches[at(a)].path() : 0;
      float sum[9] = {};
      for (std::size_t begin = 0; begin < common; begin += part_of_sum) {
        float part[9] = {};
        for (std::size_t k = begin; k < std::min(common, begin + part_of_sum); ++k) {
          const float *x = y_.y.data() + y_.index(3 * ri, k), *y = y_.y.data() + y_.index(3 * rj, k);
          for (std::size_t e = 0; e < 9; ++e) part[e] += x[e / 3] * y[e % 3];
        }
        for (std::size_t e = 0; e < 9; ++e) sum[e] += part[e];
      }
      for (std::size_t e = 0; e < 9; ++e) out[(3 * i + e / 3) * ld + 3 * j + e % 3] = sum[e];
    }
}

}  // namespace palpate
