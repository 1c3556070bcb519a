// The storages of a compliance. docs/compliance.md says which is for what.
#pragma once

#include <vector>

#include "palpate/compliance/compliance.hpp"
#include "palpate/compliance/factored.hpp"
#include "palpate/compliance/hierarchical.hpp"

namespace palpate {

// All numbers, row-major, full: the columns of the contacts are contiguous rows.
class DenseCompliance final : public ComplianceStorage {
 public:
  DenseCompliance(HugeArray<float> matrix, std::size_t nodes);
  Storage kind() const noexcept override { return Storage::dense; }
  std::size_t nodes() const noexcept override { return nodes_; }
  std::size_t bytes() const noexcept override { return matrix_.size() * sizeof(float); }
  bool mirrors_bits() const noexcept override { return true; }
  std::span<const float> matrix() const noexcept { return matrix_; }
  void apply(std::span<const Index> contacts, std::span<const float> forces, std::span<float> u,
             ComplianceWork* work = nullptr) const noexcept override;
  void block(std::span<const Index> rows, std::span<const Index> columns, std::span<float> out,
             std::size_t ld, ComplianceWork* work = nullptr) const noexcept override;

 private:
  HugeArray<float> matrix_;
  std::size_t nodes_;
};

// The same in float16, scaled by the diagonal: C_ij = scale_i scale_j value_ij, |value_ij| <= 1. Half the
// memory traffic; 5e-4 of sqrt(C_ii C_jj) off at most.
class HalfCompliance final : public ComplianceStorage {
 public:
  // values: (3 nodes)^2 float16, row-major, full; scale: 3 nodes.
  HalfCompliance(HugeArray<std::uint16_t> values, std::vector<float> scale);
  explicit HalfCompliance(std::span<const float> matrix);
  Storage kind() const noexcept override { return Storage::half; }
  std::size_t nodes() const noexcept override { return scale_.size() / 3; }
  std::size_t bytes() const noexcept override { return values_.size() * 2 + scale_.size() * sizeof(float); }
  bool mirrors_bits() const noexcept override { return true; }
  std::span<const std::uint16_t> values() const noexcept { return values_; }
  std::span<const float> scale() const noexcept { return scale_; }
  void apply(std::span<const Index> contacts, std::span<const float> forces, std::span<float> u,
             ComplianceWork* work = nullptr) const noexcept override;
  void block(std::span<const Index> rows, std::span<const Index> columns, std::span<float> out,
             std::size_t ld, ComplianceWork* work = nullptr) const noexcept override;

 private:
  HugeArray<std::uint16_t> values_;
  std::vector<float> scale_;
};

// Y of C = Y^T Y: exact to float32, ten times smaller. Every query reads much of it: for building and
// certifying, not for haptic rates.
class FactoredCompliance final : public ComplianceStorage {
 public:
  explicit FactoredCompliance(Factored<float> factored);
  Storage kind() const noexcept override { return Storage::factored; }
  std::size_t nodes() const noexcept override { return y_.load_at.size(); }
  std::size_t bytes() const noexcept override { return y_.y.size() * sizeof(float); }
  const Factored<float>& factored() const noexcept { return y_; }
  std::unique_ptr<ComplianceWork> make_work() const override;
  void apply(std::span<const Index> contacts, std::span<const float> forces, std::span<float> u,
             ComplianceWork* work = nullptr) const noexcept override;
  void block(std::span<const Index> rows, std::span<const Index> columns, std::span<float> out,
             std::size_t ld, ComplianceWork* work = nullptr) const noexcept override;

 private:
  Factored<float> y_;
  std::vector<Index> rank_of_;       // triple of ranks of each load
  std::vector<Index> branch_of_;     // branch of each triple of ranks
  std::vector<std::size_t> row_of_;  // first of each branch's rows, all branches together
  std::size_t rows_ = 0;
};

// An H2-matrix: to a certified tolerance, a few kB a node.
class HierarchicalCompliance final : public ComplianceStorage {
 public:
  explicit HierarchicalCompliance(Hierarchical matrix);
  Storage kind() const noexcept override { return Storage::hierarchical; }
  std::size_t nodes() const noexcept override { return h_.nodes; }
  std::size_t bytes() const noexcept override { return h_.values.size() * sizeof(float); }
  const Hierarchical& matrix() const noexcept { return h_; }
  Hierarchical release() && { return std::move(h_); }
  std::unique_ptr<ComplianceWork> make_work() const override;
  void apply(std::span<const Index> contacts, std::span<const float> forces, std::span<float> u,
             ComplianceWork* work = nullptr) const noexcept override;
  void block(std::span<const Index> rows, std::span<const Index> columns, std::span<float> out,
             std::size_t ld, ComplianceWork* work = nullptr) const noexcept override;

 private:
  // A block as one of its two clusters sees it.
  struct Link {
    Index other = 0;
    bool near = false, mirrored = false;  // mirrored: the block is stored for `other` as its row
    const float* values = nullptr;
  };
  std::span<const Link> links(std::size_t c) const noexcept {
    return {links_.data() + link_begin_[c], link_begin_[c + 1] - link_begin_[c]};
  }
  const Link* find(std::size_t c, std::size_t other) const noexcept;
  struct WorkSpace;
  static WorkSpace& threads_own();
  WorkSpace& work_space(ComplianceWork* given) const;
  void prepare(WorkSpace& w) const;
  std::size_t cluster_above(std::size_t leaf, int level) const noexcept {
    return ((leaf + 1) >> (h_.levels - level)) - 1;
  }
  void find_links(std::size_t place, WorkSpace& w) const noexcept;
  void expand(std::size_t place, std::size_t c, float* x) const noexcept;
  void spread(std::size_t place, WorkSpace& w) const noexcept;

  Hierarchical h_;
  std::vector<std::size_t> link_begin_;  // links of each cluster, ascending
  std::vector<Link> links_;
  std::vector<Index> place_of_;     // of each node
  std::vector<Index> leaf_of_;      // of each place
  std::vector<std::size_t> first_;  // of each cluster's coefficients, all clusters together
  std::size_t coefficients_ = 0;
};

}  // namespace palpate
