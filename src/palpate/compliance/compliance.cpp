#include "palpate/compliance/compliance.hpp"

#include <algorithm>

#include "palpate/base/error.hpp"
#include "palpate/compliance/rows.hpp"

namespace palpate {

Compliance Compliance::dense(HugeArray<float> matrix, std::size_t nodes) {
  if (matrix.size() != 9 * nodes * nodes)
    throw Error(ErrorKind::internal, "compliance of {} nodes needs {} numbers, got {}", nodes,
                9 * nodes * nodes, matrix.size());
  Compliance c;
  c.matrix_ = std::move(matrix);
  c.nodes_ = nodes;
  return c;
}

void Compliance::apply(std::span<const Index> contacts, std::span<const float> forces,
                       std::span<float> u) const noexcept {
  const std::size_t n = 3 * nodes_;
  std::fill_n(u.data(), n, 0.0f);
  // The matrix is symmetric, so its columns are rows: contiguous. Contacts that run on are one stream.
  constexpr std::size_t batch = rows_at_once / 3;
  const float* rows[rows_at_once];
  float weights[rows_at_once];
  for (std::size_t c = 0; c < contacts.size(); c += batch) {
    const std::size_t count = 3 * std::min(batch, contacts.size() - c);
    for (std::size_t k = 0; k < count; ++k) {
      rows[k] = matrix_.data() + (3 * static_cast<std::size_t>(contacts[c + k / 3]) + k % 3) * n;
      weights[k] = forces[3 * c + k];
    }
    add_rows(rows, weights, count, n, u.data());
  }
}

void Compliance::block(std::span<const Index> contacts, std::span<float> out, std::size_t ld) const noexcept {
  block(contacts, contacts, out, ld);
}

void Compliance::block(std::span<const Index> rows, std::span<const Index> columns, std::span<float> out,
                       std::size_t ld) const noexcept {
  const std::size_t n = 3 * nodes_;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const float* row = matrix_.data() + 3 * static_cast<std::size_t>(rows[i]) * n;
    float* to = out.data() + 3 * i * ld;
    for (std::size_t j = 0; j < columns.size(); ++j) {
      const float* from = row + 3 * static_cast<std::size_t>(columns[j]);
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b) to[a * ld + 3 * j + b] = from[a * n + b];
    }
  }
}

void Compliance::apply_at(std::span<const Index> rows, std::span<const Index> contacts,
                          std::span<const float> forces, std::span<float> u) const noexcept {
  const std::size_t n = 3 * nodes_;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const float* row = matrix_.data() + 3 * static_cast<std::size_t>(rows[i]) * n;
    float sum[3] = {0, 0, 0};
    for (std::size_t j = 0; j < contacts.size(); ++j) {
      const float* from = row + 3 * static_cast<std::size_t>(contacts[j]);
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b) sum[a] += from[a * n + b] * forces[3 * j + b];
    }
    std::copy_n(sum, 3, u.data() + 3 * i);
  }
}

}  // namespace palpate
