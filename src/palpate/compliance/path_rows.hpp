// Matrices with one row for each row of Y that a set of loads touches, for building the hierarchical form.
#pragma once

#include <algorithm>
#include <memory>
#include <numeric>
#include <vector>

#include "palpate/compliance/dense.hpp"
#include "palpate/compliance/factored.hpp"

namespace palpate {

// Which rows, as branches: descending, so that the root comes first.
struct PathRows {
  std::vector<Index> branches;
  std::vector<std::size_t> first;  // of each branch's rows, here
  std::size_t size = 0;
};

// Column-major, rows.size x columns.
struct PathMatrix {
  PathMatrix() = default;
  PathMatrix(const PathRows& r, std::size_t n) : rows(&r), columns(n), values(r.size * n, 0.0f) {}
  const PathRows* rows = nullptr;
  std::size_t columns = 0;
  std::vector<float> values;
  float* at(std::size_t row, std::size_t column) { return values.data() + column * rows->size + row; }
  const float* at(std::size_t row, std::size_t column) const {
    return values.data() + column * rows->size + row;
  }
};

// run(first row in a, first row in b, rows) for the rows that both have, as few runs as possible.
template <class Run>
void for_common_rows(const PathRows& a, const PathRows& b, const Run& run) {
  std::size_t from_a = 0, from_b = 0, length = 0;
  const auto end_of = [](const PathRows& r, std::size_t i) {
    return i + 1 < r.first.size() ? r.first[i + 1] : r.size;
  };
  for (std::size_t i = 0, j = 0; i < a.branches.size() && j < b.branches.size();) {
    if (a.branches[i] != b.branches[j]) {
      a.branches[i] > b.branches[j] ? ++i : ++j;
      continue;
    }
    if (length > 0 && (from_a + length != a.first[i] || from_b + length != b.first[j])) {
      run(from_a, from_b, length);
      length = 0;
    }
    if (length == 0) from_a = a.first[i], from_b = b.first[j];
    length += end_of(a, i) - a.first[i];
    ++i, ++j;
  }
  if (length > 0) run(from_a, from_b, length);
}

// to += factor from, on the rows that both have.
inline void add(const PathMatrix& from, float factor, PathMatrix& to) {
  for_common_rows(*from.rows, *to.rows, [&](std::size_t a, std::size_t b, std::size_t n) {
    for (std::size_t c = 0; c < to.columns; ++c) {
      const float* x = from.at(a, c);
      float* y = to.at(b, c);
      for (std::size_t i = 0; i < n; ++i) y[i] += factor * x[i];
    }
  });
}

// out = a^T b over the rows that both have, the first `columns` of b: column-major, leading dimension ld.
inline void multiply_paths(const PathMatrix& a, const PathMatrix& b, std::size_t columns, float* out,
                           std::size_t ld) {
  for (std::size_t c = 0; c < columns; ++c) std::fill_n(out + c * ld, a.columns, 0.0f);
  if (a.columns == 0 || columns == 0) return;
  for_common_rows(*a.rows, *b.rows, [&](std::size_t i, std::size_t j, std::size_t n) {
    cblas_sgemm(CblasColMajor, CblasTrans, CblasNoTrans, dense::blas(a.columns), dense::blas(columns),
                dense::blas(n), 1, a.at(i, 0), dense::blas(a.rows->size), b.at(j, 0),
                dense::blas(b.rows->size), 1, out, dense::blas(ld));
  });
}

// What the loads of the leaves see of Y.
class LeafPaths {
 public:
  LeafPaths(const Factored<float>& y, std::span<const Index> order);
  // The rows that some of these places' loads touch.
  PathRows rows(std::size_t begin, std::size_t end) const;
  static PathRows merge(const Factored<float>& y, const PathRows& a, const PathRows& b);
  // Those of `rows` whose branches are wanted.
  static PathRows part(const Factored<float>& y, const PathRows& rows,
                       const std::vector<std::uint8_t>& wanted);
  // Y of the places begin .. end - 1, one column a load's unknown.
  PathMatrix columns(const PathRows& rows, std::size_t begin, std::size_t end) const;

 private:
  const Factored<float>& y_;
  std::span<const Index> order_;
  std::vector<Index> rank_of_, branch_of_;  // of each load; of each triple of ranks
};

}  // namespace palpate
