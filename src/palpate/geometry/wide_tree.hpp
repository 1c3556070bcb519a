// A tree of eight children a node, for searches of the closest triangle: each child is bounded by a box
// turned to lie along its triangles (Gottschalk, Lin, Manocha, "OBBTree", 1996), nearly as flat as the
// surface there. Distances to eight boxes, or eight triangles, are found at once in float32 (Wald, Benthin,
// Boulos, "Getting rid of packets", 2008); what may be nearest, give or take their rounding, is left to
// float64.
#pragma once

#include <array>
#include <vector>

#include "palpate/base/simd.hpp"
#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

class WideTree {
 public:
  struct Range {  // a node of a binary tree: its slots and its children, none (0) for a leaf of at most 8
    Index begin, end;
    Index child;  // the first of two
  };
  WideTree() = default;
  // corners: those of each slot.
  WideTree(const std::vector<Range>& binary, const std::vector<std::array<Vec3, 3>>& corners, Simd simd);

  struct Query {
    Vec3 p;
    double bound;  // only what is nearer, m
    Index hint;    // a slot that is probably near, or -1
    // Takes slots that may hold the nearest triangle, all of them in one call but for strange cases.
    void (*take)(void* context, const Index* slots, std::size_t n);
    void* context;
  };
  void search(const Query& query) const;

  // Coordinates are scaled to about 1. `lanes`: the bits of those that are there.
  using Lanes = std::array<float, 8>;
  struct alignas(64) Boxes {
    std::array<std::array<Lanes, 3>, 3> axis;  // [axis][component], orthonormal
    std::array<Lanes, 3> middle, half;         // along each axis
    std::array<Index, 8> child;                // a node, or ~number of a leaf
    unsigned lanes;
  };
  struct alignas(64) Triangles {
    std::array<Lanes, 3> origin;               // corner 0
    std::array<std::array<Lanes, 3>, 3> axis;  // along edge 01; across it in the plane; the normal
    Lanes x1, x2, y2;                          // corners 1 (x1, 0) and 2 in the plane
    Lanes inverse12, inverse20;                // 1 / squared length of the edges
    Index first;                               // its slots are first, first + 1, ...
    unsigned lanes, thin;                      // thin: too thin for this; always left to float64
  };

 private:
  void fit(Boxes& boxes, std::size_t lane, Index begin, Index end) const;
  void add_leaf(Index begin, Index end);
  template <class Kernels>
  void search_with(const Query& query) const;
  void search_avx2(const Query& query) const;

  Simd simd_ = Simd::portable;
  Vec3 center_ = Vec3::Zero();
  double scale_ = 1, longest_ = 0;  // m; longest edge, scaled
  std::vector<Boxes> nodes_;
  std::vector<Triangles> leaves_;
  std::vector<Index> leaf_of_;                // each slot
  std::vector<std::array<Vec3, 3>> corners_;  // scaled; only while it is built
};

}  // namespace palpate
