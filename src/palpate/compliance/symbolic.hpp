// The structure of a sparse Cholesky factor, before any number is known: the tree of fronts. Liu, "The role
// of elimination trees in sparse factorization" (1990); Ashcraft, Grimes, "The influence of relaxed supernode
// partitions on the multifrontal method" (1989).
#pragma once

#include <span>
#include <vector>

#include "palpate/base/vec.hpp"
#include "palpate/compliance/ordering.hpp"

namespace palpate {

// Fronts with this much padding are merged into their parents: fewer, larger dense blocks against more zeros
// in them. A front of at most `nodes` nodes may consist of zeros to at most this part; in order of `nodes`.
// Larger ones are left alone: two large separators merged, even without a zero in L, are put below all the
// loads of both, a third more work in the sweep.
struct Relaxation {
  Index nodes;
  double zeros;
};
std::span<const Relaxation> default_relaxation();

// A set of nodes eliminated together, that couple to the same later nodes. Their part of L is one dense
// panel of height() x 3 pivots, column-major, rows: the pivots' unknowns, then those of `below`.
struct Front {
  Index first = 0, pivots = 0;  // positions first .. first + pivots - 1, nodes
  Index below = 0;              // number of later nodes that it couples to
  Index parent = -1;
  std::size_t rows = 0;   // where its `below` entries start in Symbolic::rows and Symbolic::place
  std::size_t panel = 0;  // where its panel starts in L

  std::size_t width() const { return 3 * static_cast<std::size_t>(pivots); }
  std::size_t below_rows() const { return 3 * static_cast<std::size_t>(below); }
  std::size_t height() const { return width() + below_rows(); }
};

struct Symbolic {
  std::vector<Index> node_at;      // node of the matrix at each position of the elimination
  std::vector<Index> position_of;  // and back
  std::vector<Front> fronts;       // in postorder
  std::vector<Index> rows;         // positions below the pivots of each front, ascending
  std::vector<Index> place;        // where each of `rows` is in the parent's front: pivots first, then below
  std::vector<Index> child_begin, children;  // children of each front, ascending
  std::size_t panel_entries = 0;             // of all panels

  std::span<const Index> rows_of(const Front& f) const {
    return {rows.data() + f.rows, static_cast<std::size_t>(f.below)};
  }
  std::span<const Index> place_of(const Front& f) const {
    return {place.data() + f.rows, static_cast<std::size_t>(f.below)};
  }
  std::span<const Index> children_of(std::size_t front) const {
    return {children.data() + child_begin[front],
            static_cast<std::size_t>(child_begin[front + 1] - child_begin[front])};
  }
};

// order: a permutation of the graph's nodes. Throws Error(internal) where it is none.
Symbolic analyse(const NodeGraph& graph, const std::vector<Index>& order,
                 std::span<const Relaxation> relaxation = default_relaxation());

}  // namespace palpate
