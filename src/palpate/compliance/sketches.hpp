// Random sketches of Y for clusters of surface nodes: what building and certifying the hierarchical form
// share.
#pragma once

#include "palpate/base/parallel_for.hpp"
#include "palpate/compliance/cholesky_impl.hpp"
#include "palpate/compliance/hierarchical.hpp"
#include "palpate/compliance/path_rows.hpp"

namespace palpate {

// The same numbers for the same seed and cluster: the columns of a leaf's probes.
std::vector<float> gaussian(unsigned seed, std::size_t leaf, std::size_t count);

// a x, x column-major with as many rows as a has columns.
PathMatrix times(const PathMatrix& a, const float* x, std::size_t columns);

class Sketches {
 public:
  Sketches(const Factored<float>& y, const Hierarchical& h, int threads);
  // Norms of all clusters, and Y times Gaussian probes for those from top(), the level of the largest far
  // blocks, down to level `lowest`. Adds 1 to `done` for each leaf.
  void make(unsigned seed, std::size_t probes, int lowest, SharedProgress& done);
  // Y times the probes of one cluster, from its leaves; to be dropped when it is not needed any more.
  void make_one(unsigned seed, std::size_t probes, std::size_t c) { of_[c] = sum(seed, probes, c); }
  void drop(std::size_t c) { of_[c] = {}; }

  const PathMatrix& of(std::size_t c) const { return of_[c]; }
  // Of Y: all of a leaf; above, only those shared with some cluster far from it or from one above it.
  const PathRows& rows(std::size_t c) const { return rows_[c]; }
  double norm(std::size_t c) const { return norm_[c]; }  // of the cluster's own block of C, from below
  int top() const { return top_; }
  const std::vector<Index>& far_of(std::size_t c) const { return far_of_[c]; }
  // Y of a leaf's loads.
  PathMatrix columns(std::size_t leaf) const {
    return paths_.columns(rows_[leaf], h_.begin(leaf), h_.end(leaf));
  }
  // The clusters of a level, in parallel.
  template <class Body>
  void each(int level, const Body& body) const {
    const std::size_t first = (std::size_t{1} << level) - 1;
    parallel_for(std::size_t{1} << level, 1, threads_, [&](std::size_t i, std::size_t) { body(first + i); });
  }

 private:
  void find_rows(const Factored<float>& y);
  PathMatrix sum(unsigned seed, std::size_t probes, std::size_t c) const;
  PathMatrix rise(unsigned seed, std::size_t probes, int lowest, std::size_t c, PathMatrix* above,
                  SharedProgress& done);
  void set_norm(std::size_t c, const PathMatrix& moved);

  const Hierarchical& h_;
  int threads_, top_;
  LeafPaths paths_;
  std::vector<std::vector<Index>> far_of_;
  std::vector<PathRows> all_rows_, rows_;
  std::vector<PathMatrix> of_;
  std::vector<double> norm_;
};

}  // namespace palpate
