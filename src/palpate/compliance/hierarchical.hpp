// The compliance as an H2-matrix: far pairs of clusters of surface nodes couple through few vectors, which
// are nested from leaves to root; near pairs of leaves are stored as they are. Built from the factored form
// by random sketches, never from the dense matrix; its error is certified block by block. Hackbusch,
// Khoromskij, Sauter, "On H2-matrices" (2000); Halko, Martinsson, Tropp, "Finding structure with randomness"
// (2011, eq. 4.3: the certificate); Lin, Lu, Ying, "Fast construction of hierarchical matrix representation
// from matrix-vector multiplication" (2011).
#pragma once

#include <span>
#include <vector>

#include "palpate/base/huge_array.hpp"
#include "palpate/base/progress.hpp"
#include "palpate/base/vec.hpp"
#include "palpate/compliance/factored.hpp"

namespace palpate {

// Clusters form a complete binary tree, numbered as a heap: the root is 0, the children of c are 2 c + 1 and
// 2 c + 2. All leaves are on level `levels`.
struct Hierarchical {
  std::size_t nodes = 0;
  int levels = 0;
  std::vector<Index> order;  // node at each place; a cluster is a range of places
  std::vector<Index> rank;   // of each cluster: the width of its basis, 0 above all far blocks
  struct Block {
    Index row = 0, column = 0;  // clusters of one level, row >= column; the mirror image is not stored
    bool near = false;          // leaves, all numbers; otherwise rank x rank between the bases
    std::size_t values = 0;     // offset into values; column-major
  };
  std::vector<Block> blocks;  // by row, then column, so parents first
  // Of each cluster: a leaf's basis, 3 size x rank; above, what carries its basis into its parent's, rank x
  // parent's rank; column-major.
  std::vector<std::size_t> basis, transfer;
  HugeArray<float> values;
  double tolerance = 0;  // as asked for
  double error = 0;   // certified: largest over the blocks, relative to sqrt(|C_row,row| |C_column,column|)
  double lowest = 0;  // smallest eigenvalue found, each leaf's own block scaled to the identity

  std::size_t clusters() const { return (std::size_t{2} << levels) - 1; }
  static int level(std::size_t c) { return 63 - __builtin_clzll(c + 1); }
  std::size_t begin(std::size_t c) const {
    return ((c + 1) - (std::size_t{1} << level(c))) * nodes >> level(c);
  }
  std::size_t end(std::size_t c) const {
    return ((c + 2) - (std::size_t{1} << level(c))) * nodes >> level(c);
  }
  std::size_t unknowns(std::size_t c) const { return 3 * (end(c) - begin(c)); }
  bool leaf(std::size_t c) const { return level(c) == levels; }
  std::size_t width(std::size_t c) const { return static_cast<std::size_t>(rank[c]); }
  // Sets the offsets from ranks and blocks. Returns the size of `values`.
  std::size_t arrange();
};

constexpr double smallest_tolerance = 1e-5;
constexpr std::size_t certificate_probes = 30;  // wrong once in 2^30

// positions: of the loads, m. Tightens by itself until the certificate keeps to the tolerance and the matrix
// is positive definite. Throws Error(physics) where that cannot be had.
Hierarchical compress(const Factored<float>& factored, std::span<const Vec3> positions, double tolerance,
                      int threads = 0, const Progress& progress = {});

// Peak bytes of compress() beside Y itself, known before there are numbers in Y: see factored_outline.
std::size_t compress_bytes(const Factored<float>& outline, std::span<const Vec3> positions, double tolerance,
                           int threads = 0);

// The certificate: for each block, 30 Gaussian probes bound the spectral norm of its error against the
// factored form, wrong once in 1e9; relative to sqrt(|C_row,row| |C_column,column|) of the block.
std::vector<double> block_errors(const Hierarchical& h, const Factored<float>& factored, int threads = 0,
                                 const Progress& progress = {});

// Smallest eigenvalue by Lanczos' method, the leaves' own blocks scaled to the identity; negative: the matrix
// is not positive definite, to the rounding of float32.
class HierarchicalCompliance;
double lowest_eigenvalue(const HierarchicalCompliance& compliance);

}  // namespace palpate
