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
      rows_(h.clusters()),
      of_(h.clusters()),
      norm_(h.clusters()) {
  for (const auto& b : h.blocks)
    if (!b.near) top_ = std::min(top_, Hierarchical::level(at(b.row)));
  each(h.levels, [&](std::size_t c) { rows_[c] = paths_.rows(h.begin(c), h.end(c)); });
  for (int l = h.levels - 1; l >= top_; --l)
    each(l, [&](std::size_t c) { rows_[c] = LeafPaths::merge(y, rows_[2 * c + 1], rows_[2 * c + 2]); });
}

void Sketches::make_leaf(unsigned seed, std::size_t probes, std::size_t c) {
  const PathMatrix own = columns(c);
  // Gaussian numbers, and the three translations, which give the norms.
  std::vector<float> x = gaussian(seed, c, own.columns * probes);
  x.resize(own.columns * (probes + 3));
  for (std::size_t i = 0; i < own.columns; ++i) x[own.columns * (probes + i % 3) + i] = 1;
  of_[c] = times(own, x.data(), probes + 3);
}

void Sketches::make(unsigned seed, std::size_t probes, bool keep_leaves, const Progress& progress) {
  const auto leaf = [&](std::size_t c) {
    make_leaf(seed, probes, c);
    set_norm(c, probes);
  };
  if (top_ == h_.levels) each(h_.levels, leaf);
  for (int l = h_.levels - 1; l >= top_; --l)
    each(l, [&](std::size_t c) {
      const std::size_t children[] = {2 * c + 1, 2 * c + 2};
      of_[c] = PathMatrix(rows_[c], probes + 3);
      for (const std::size_t child : children) {
        if (h_.leaf(child)) leaf(child);
        add(of_[child], 1, of_[c]);
        if (h_.leaf(child) && !keep_leaves) drop(child);
      }
      set_norm(c, probes);
      stop_if_asked(progress);
    });
}

// The largest Rayleigh quotient of the translations.
void Sketches::set_norm(std::size_t c, std::size_t probes) {
  const Eigen::Map<const Eigen::MatrixXf> moved(of_[c].at(0, probes),
                                                static_cast<Eigen::Index>(rows_[c].size), 3);
  const Eigen::Matrix3d gram = moved.cast<double>().transpose() * moved.cast<double>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(gram, Eigen::EigenvaluesOnly);
  norm_[c] = eigen.eigenvalues()[2] / static_cast<double>(h_.end(c) - h_.begin(c));
}

}  // namespace palpate
