#include "palpate/compliance/sketches.hpp"

#include <Eigen/Eigenvalues>
#include <random>

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

}  // namespace

std::vector<float> gaussian(unsigned seed, std::size_t leaf, std::size_t count) {
  std::mt19937_64 random(seed + 7919 * leaf);
  std::normal_distribution<float> normal;
  std::vector<float> out(count);
  for (float& x : out) x = normal(random);
  return out;
}

PathMatrix times(const PathMatrix& a, const float* x, std::size_t columns) {
  PathMatrix out(*a.rows, columns);
  const int m = dense::blas(a.rows->size), n = dense::blas(columns), k = dense::blas(a.columns);
  if (m > 0 && n > 0 && k > 0)
    cblas_sgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, m, n, k, 1, a.at(0, 0), m, x, k, 0, out.at(0, 0),
                m);
  return out;
}

Sketches::Sketches(const Factored<float>& y, const Hierarchical& h, int threads)
    : h_(h),
      threads_(threads),
      top_(h.levels),
      paths_(y, h.order),
      far_of_(h.clusters()),
      all_rows_(h.clusters()),
      rows_(h.clusters()),
      of_(h.clusters()),
      norm_(h.clusters()) {
  for (const auto& b : h.blocks) {
    if (b.near) continue;
    top_ = std::min(top_, Hierarchical::level(at(b.row)));
    far_of_[at(b.row)].push_back(b.column);
    far_of_[at(b.column)].push_back(b.row);
  }
  find_rows(y);
}

// Clusters far from each other share only rows of fronts above both: the many rows that a large cluster has
// for itself are in no product.
void Sketches::find_rows(const Factored<float>& y) {
  each(h_.levels, [&](std::size_t c) { all_rows_[c] = paths_.rows(h_.begin(c), h_.end(c)); });
  for (int l = h_.levels - 1; l >= top_; --l)
    each(l, [&](std::size_t c) {
      all_rows_[c] = LeafPaths::merge(y, all_rows_[2 * c + 1], all_rows_[2 * c + 2]);
    });
  for (int l = top_; l < h_.levels; ++l)
    each(l, [&](std::size_t c) {
      std::vector<std::uint8_t> wanted(y.branches.size(), 0);
      for (const Index other : far_of_[c])
        for (const Index b : all_rows_[at(other)].branches) wanted[at(b)] = 1;
      if (l > top_)
        for (const Index b : rows_[(c - 1) / 2].branches) wanted[at(b)] = 1;
      rows_[c] = LeafPaths::part(y, all_rows_[c], wanted);
    });
  each(h_.levels, [&](std::size_t c) { rows_[c] = all_rows_[c]; });
}

PathMatrix Sketches::sum(unsigned seed, std::size_t probes, std::size_t c) const {
  if (h_.leaf(c)) {
    const PathMatrix own = columns(c);
    return times(own, gaussian(seed, c, own.columns * probes).data(), probes);
  }
  PathMatrix out(rows_[c], probes);
  for (const std::size_t child : {2 * c + 1, 2 * c + 2}) add(sum(seed, probes, child), 1, out);
  return out;
}

// Adds the sketch to that of the cluster above, if that is wanted. Returns Y times the three translations, on
// all of the cluster's rows: they give its norm.
PathMatrix Sketches::rise(unsigned seed, std::size_t probes, int lowest, std::size_t c, PathMatrix* above,
                          SharedProgress& done) {
  const bool kept = Hierarchical::level(c) <= lowest;
  PathMatrix sketch, moved;
  if (h_.leaf(c)) {
    const PathMatrix own = columns(c);
    std::vector<float> x(3 * own.columns);
    for (std::size_t i = 0; i < own.columns; ++i) x[own.columns * (i % 3) + i] = 1;
    moved = times(own, x.data(), 3);
    if (kept || above) sketch = times(own, gaussian(seed, c, own.columns * probes).data(), probes);
    done.add(1);
  } else {
    if (kept || above) sketch = PathMatrix(rows_[c], probes);
    moved = PathMatrix(all_rows_[c], 3);
    for (const std::size_t child : {2 * c + 1, 2 * c + 2})
      add(rise(seed, probes, lowest, child, kept || above ? &sketch : nullptr, done), 1, moved);
  }
  set_norm(c, moved);
  if (above) add(sketch, 1, *above);
  if (kept) of_[c] = std::move(sketch);
  return moved;
}

void Sketches::make(unsigned seed, std::size_t probes, int lowest, SharedProgress& done) {
  each(top_, [&](std::size_t c) { rise(seed, probes, lowest, c, nullptr, done); });
}

// The largest Rayleigh quotient of the translations.
void Sketches::set_norm(std::size_t c, const PathMatrix& moved) {
  const Eigen::Map<const Eigen::MatrixXf> m(moved.values.data(), static_cast<Eigen::Index>(moved.rows->size),
                                            3);
  const Eigen::Matrix3d gram = m.cast<double>().transpose() * m.cast<double>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(gram, Eigen::EigenvaluesOnly);
  norm_[c] = eigen.eigenvalues()[2] / static_cast<double>(h_.end(c) - h_.begin(c));
}

}  // namespace palpate
