#include <algorithm>
#include <cmath>

#include "palpate/base/error.hpp"
#include "palpate/base/half.hpp"
#include "palpate/base/parallel_for.hpp"
#include "palpate/compliance/rows.hpp"
#include "palpate/compliance/storage.hpp"

namespace palpate {

namespace {

// u += the columns of the contacts. The matrix is symmetric, so its columns are rows: contiguous.
// weight(k): of row k of the contacts' 3 contacts.size().
template <class T, class Weight>
void add_columns(const T* matrix, std::size_t n, std::span<const Index> contacts, const Weight& weight,
                 float* u) noexcept {
  constexpr std::size_t batch = rows_at_once / 3;
  const T* rows[rows_at_once];
  float weights[rows_at_once];
  for (std::size_t c = 0; c < contacts.size(); c += batch) {
    const std::size_t count = 3 * std::min(batch, contacts.size() - c);
    for (std::size_t k = 0; k < count; ++k) {
      rows[k] = matrix + (3 * static_cast<std::size_t>(contacts[c + k / 3]) + k % 3) * n;
      weights[k] = weight(3 * c + k);
    }
    add_rows(rows, weights, count, n, u);
  }
}

template <class Entry>
void copy_block(std::span<const Index> rows, std::span<const Index> columns, std::span<float> out,
                std::size_t ld, const Entry& entry) noexcept {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::size_t row = 3 * static_cast<std::size_t>(rows[i]);
    float* to = out.data() + 3 * i * ld;
    for (std::size_t j = 0; j < columns.size(); ++j) {
      const std::size_t column = 3 * static_cast<std::size_t>(columns[j]);
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b) to[a * ld + 3 * j + b] = entry(row + a, column + b);
    }
  }
}

}  // namespace

DenseCompliance::DenseCompliance(HugeArray<float> matrix, std::size_t nodes)
    : matrix_(std::move(matrix)), nodes_(nodes) {
  if (matrix_.size() != 9 * nodes * nodes)
    throw Error(ErrorKind::internal, "compliance of {} nodes needs {} numbers, got {}", nodes,
                9 * nodes * nodes, matrix_.size());
}

void DenseCompliance::apply(std::span<const Index> contacts, std::span<const float> forces,
                            std::span<float> u, ComplianceWork*) const noexcept {
  const std::size_t n = 3 * nodes_;
  std::fill_n(u.data(), n, 0.0f);
  add_columns(
      matrix_.data(), n, contacts, [&](std::size_t k) { return forces[k]; }, u.data());
}

void DenseCompliance::block(std::span<const Index> rows, std::span<const Index> columns, std::span<float> out,
                            std::size_t ld, ComplianceWork*) const noexcept {
  const float* c = matrix_.data();
  const std::size_t n = 3 * nodes_;
  copy_block(rows, columns, out, ld, [=](std::size_t i, std::size_t j) { return c[i * n + j]; });
}

HalfCompliance::HalfCompliance(HugeArray<std::uint16_t> values, std::vector<float> scale)
    : values_(std::move(values)), scale_(std::move(scale)) {
  if (scale_.size() % 3 != 0 || values_.size() != scale_.size() * scale_.size())
    throw Error(ErrorKind::internal, "compliance of {} numbers with {} scales", values_.size(),
                scale_.size());
}

HalfCompliance::HalfCompliance(std::span<const float> matrix) {
  const auto n = static_cast<std::size_t>(std::llround(std::sqrt(static_cast<double>(matrix.size()))));
  if (n % 3 != 0 || n * n != matrix.size())
    throw Error(ErrorKind::internal, "{} numbers are no compliance", matrix.size());
  scale_.resize(n);
  for (std::size_t i = 0; i < n; ++i) scale_[i] = std::sqrt(matrix[i * (n + 1)]);
  std::vector<float> inverse(n);
  for (std::size_t i = 0; i < n; ++i) inverse[i] = scale_[i] > 0 ? 1 / scale_[i] : 0;
  values_ = HugeArray<std::uint16_t>(n * n);
  parallel_for(n, 64, 0, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t j = 0; j < n; ++j)
        values_[i * n + j] = to_half(matrix[i * n + j] * (inverse[i] * inverse[j]));
  });
}

void HalfCompliance::apply(std::span<const Index> contacts, std::span<const float> forces, std::span<float> u,
                           ComplianceWork*) const noexcept {
  const std::size_t n = scale_.size();
  std::fill_n(u.data(), n, 0.0f);
  add_columns(
      values_.data(), n, contacts,
      [&](std::size_t k) {
        return forces[k] * scale_[3 * static_cast<std::size_t>(contacts[k / 3]) + k % 3];
      },
      u.data());
  for (std::size_t i = 0; i < n; ++i) u[i] *= scale_[i];
}

void HalfCompliance::block(std::span<const Index> rows, std::span<const Index> columns, std::span<float> out,
                           std::size_t ld, ComplianceWork*) const noexcept {
  copy_block(rows, columns, out, ld, [&](std::size_t i, std::size_t j) {
    return from_half(values_[i * scale_.size() + j]) * (scale_[i] * scale_[j]);
  });
}

}  // namespace palpate
