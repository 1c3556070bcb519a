// Random sketches of Y for clusters of surface nodes: what building and certifying the hierarchical form
// share.
#pragma once

#include "palpate/base/parallel_for.hpp"
#include "palpate/compliance/hierarchical.hpp"
#include "palpate/compliance/path_rows.hpp"

namespace palpate {

inline void stop_if_asked(const Progress& progress) { Progress{nullptr, progress.interrupted}.at(0); }

// The same numbers for the same seed and cluster: the columns of a leaf's probes.
std::vector<float> gaussian(unsigned seed, std::size_t leaf, std::size_t count);

// a x, x column-major with as many rows as a has columns.
PathMatrix times(const PathMatrix& a, const float* x, std::size_t columns);

class Sketches {
 public:
  Sketches(const Factored<float>& y, const Hierarchical& h, int threads);
  // Y times Gaussian probes for each cluster, from the leaves up to top(), the level of the largest far
  // blocks. keep_leaves: false to make the leaves' again when they are needed, by make_leaf: they are half of
  // all.
  void make(unsigned seed, std::size_t probes, bool keep_leaves, const Progress& progress);
  void make_leaf(unsigned seed, std::size_t probes, std::size_t c);
  void drop(std::size_t c) { of_[c] = {}; }

  const PathMatrix& of(std::size_t c) const { return of_[c]; }
  const PathRows& rows(std::size_t c) const { return rows_[c]; }
  double norm(std::size_t c) const { return norm_[c]; }  // of the cluster's own block of C, from below
  int top() const { return top_; }
  // Y of a cluster's loads.
  PathMatrix columns(std::size_t c) const { return paths_.columns(rows_[c], h_.begin(c), h_.end(c)); }
  // The clusters of a level, in parallel.
  template <class Body>
  void each(int level, const Body& body) const {
    const std::size_t first = (std::size_t{1} << level) - 1;
    parallel_for(std::size_t{1} << level, 1, threads_, [&](std::size_t i, std::size_t) { body(first + i); });
  }

 private:
  void set_norm(std::size_t c, std::size_t probes);

  const Hierarchical& h_;
  int threads_, top_;
  LeafPaths paths_;
  std::vector<PathRows> rows_;
  std::vector<PathMatrix> of_;
  std::vector<double> norm_;
};

}  // namespace palpate
