// Tetrahedra that can be reconnected and whose free nodes can be moved: what boundary recovery and quality
// improvement work on. Klincsek, "Minimal triangulations of polygonal domains" (1980); Freitag,
// Ollivier-Gooch, "Tetrahedral mesh improvement using swapping and smoothing" (1997); Shewchuk, "Two discrete
// optimization algorithms for the topological improvement of tetrahedral meshes" (2002).
#pragma once

#include <functional>
#include <span>
#include <unordered_set>
#include <vector>

#include "palpate/base/vec.hpp"

namespace palpate {

using Edge = std::array<Index, 2>;

// The smallest sine of the six dihedral angles: 0.943 for a regular tetrahedron, 0 or less for a flat or
// inverted one.
double shape(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d);

class FlipMesh {
 public:
  FlipMesh(std::vector<Vec3> nodes, std::span<const Tetrahedron> tets);  // all labels 0

  std::vector<Vec3> nodes;
  const std::vector<Tetrahedron>& tets() const { return tets_; }  // dead ones have t[0] = -1
  bool alive(Index t) const { return tets_[static_cast<std::size_t>(t)][0] >= 0; }
  const Tetrahedron& tet(Index t) const { return tets_[static_cast<std::size_t>(t)]; }
  const Vec3& node(Index v) const { return nodes[static_cast<std::size_t>(v)]; }
  std::span<const Index> around(Index v) const { return around_[static_cast<std::size_t>(v)]; }
  double shape_of(const Tetrahedron& t) const {
    return shape(node(t[0]), node(t[1]), node(t[2]), node(t[3]));
  }

  bool has_edge(Index a, Index b) const;
  // Tetrahedron on the side the counter-clockwise face (a, b, c) faces away from, -1: none. The face exists
  // when this or the same of (a, c, b) does.
  Index below(Index a, Index b, Index c) const;
  bool has_face(Index a, Index b, Index c) const { return below(a, b, c) >= 0 || below(a, c, b) >= 0; }

  // Edges and faces no flip may destroy. A protected face protects its edges.
  void protect_edge(Index a, Index b);
  void protect_face(Index a, Index b, Index c);
  bool is_protected(Index a, Index b) const { return edges_.count(edge_key(a, b)) > 0; }

  // Vertices about edge ab in order, counter-clockwise seen from b; empty when the edge is on the boundary.
  std::vector<Index> ring(Index a, Index b) const;

  // Each of these changes the mesh and returns true only if all new tetrahedra are better than `floor` and
  // the result is a mesh again; with floor `improve` better than the worst of the replaced ones.
  static constexpr double improve = -2;
  // Retriangulates the ring of edge ab without ab, best smallest shape; `wanted`: edges between ring vertices
  // the result must not cross (so it holds them, when it can).
  bool remove_edge(Index a, Index b, double floor, std::span<const Edge> wanted = {});
  // Replaces the two tetrahedra on face (a, b, c) by three about the edge between their apexes.
  bool remove_face(Index a, Index b, Index c, double floor);
  // Puts a new node at p in place of the middle of edge ab and returns it, whatever becomes of the shapes;
  // -1: the edge is protected or on the boundary. The node is the last one; whoever takes the change back
  // removes it.
  Index split_edge(Index a, Index b, const Vec3& p);
  // Changes made since forget(). undo() takes back the last one, undo(n) all but the first n; nodes made by
  // split_edge go too.
  std::size_t changes() const { return journal_.size(); }
  void undo();
  void undo(std::size_t n) {
    while (journal_.size() > n) undo();
  }
  void forget() { journal_.clear(); }

  void kill(Index t);
  Index add(const Tetrahedron& t, Index label);
  // Label of each tetrahedron (its region), for the caller; replaced ones hand theirs on.
  std::vector<Index> labels;

 private:
  static std::uint64_t edge_key(Index a, Index b) {
    if (a > b) std::swap(a, b);
    return static_cast<std::uint64_t>(a) << 32 | static_cast<std::uint64_t>(b);
  }
  struct FaceHash {
    std::size_t operator()(const Triangle& t) const;
  };
  void replace(std::span<const Index> old, std::span<const Tetrahedron> fresh, bool made_node = false);

  std::vector<Tetrahedron> tets_;
  std::vector<Index> free_;
  std::vector<std::vector<Index>> around_;  // tetrahedra of each node
  std::unordered_set<std::uint64_t> edges_;
  std::unordered_set<Triangle, FaceHash> faces_;
  struct Change {
    std::vector<Tetrahedron> removed;
    std::vector<Index> added;
    Index label;
    std::size_t slots;  // of tets_, before
    bool made_node;
  };
  std::vector<Change> journal_;
};

}  // namespace palpate
