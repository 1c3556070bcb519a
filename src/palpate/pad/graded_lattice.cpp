#include "palpate/pad/graded_lattice.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <unordered_set>

namespace palpate {

namespace {

using Place = std::array<std::int32_t, 3>;

constexpr std::int32_t offset = 1 << 20;  // makes places positive for packing
std::uint64_t pack(const Place& p) {
  std::uint64_t key = 0;
  for (const std::int32_t x : p) key = key << 21 | static_cast<std::uint64_t>(x + offset);
  return key;
}
Place unpack(std::uint64_t key) {
  const auto at = [&](unsigned shift) {
    return static_cast<std::int32_t>(key >> shift & ((std::uint64_t{1} << 21) - 1)) - offset;
  };
  return {at(42), at(21), at(0)};
}

// Cells of one level are numbered by their place in units of their own size.
class Octree {
 public:
  Octree(GradedLattice& lattice, int levels, std::size_t most, const std::function<Depth(const Vec3&)>& depth)
      : lattice_(lattice), most_(most), depth_(depth), leaves_(static_cast<std::size_t>(levels) + 1) {}

  int levels() const { return static_cast<int>(leaves_.size()) - 1; }
  bool leaf(int level, const Place& p) const {
    return level <= levels() && leaves_[static_cast<std::size_t>(level)].count(pack(p)) > 0;
  }
  static Place center(int level, const Place& p) {  // in units of cell / 2
    return {(2 * p[0] + 1) << level, (2 * p[1] + 1) << level, (2 * p[2] + 1) << level};
  }

  void divide(int level, const Place& p) {
    const Place c = center(level, p);
    const Vec3 at = lattice_.origin + 0.5 * lattice_.cell * Vec3(c[0], c[1], c[2]);
    const Depth d = depth_(at);
    // From here to the farthest centre of a finest cell in this one.
    const double reach = std::sqrt(0.75) * lattice_.cell * ((1 << level) - 1);
    if (d.outer > 1.01 * lattice_.cell + reach) return;
    if (level > 0 && d.nearest < 2.02 * lattice_.cell + reach)
      for (int child = 0; child < 8; ++child)
        divide(level - 1, {2 * p[0] + (child >> 2), 2 * p[1] + (child >> 1 & 1), 2 * p[2] + (child & 1)});
    else
      insert(level, p);
  }

  // No leaf has a neighbour (by face, edge or corner) that is more than twice as large.
  void balance() {
    for (int level = 0; level + 2 <= levels(); ++level) {
      const auto fine = leaves_[static_cast<std::size_t>(level)];
      for (const std::uint64_t key : fine) {
        const Place p = unpack(key);
        for (int n = 0; n < 27; ++n)
          split_above(level + 1,
                      {(p[0] + n / 9 - 1) >> 1, (p[1] + n / 3 % 3 - 1) >> 1, (p[2] + n % 3 - 1) >> 1});
      }
    }
  }

  std::vector<Place> sorted(int level) const {
    const auto& set = leaves_[static_cast<std::size_t>(level)];
    std::vector<std::uint64_t> keys(set.begin(), set.end());
    std::sort(keys.begin(), keys.end());
    std::vector<Place> out;
    for (const std::uint64_t key : keys) out.push_back(unpack(key));
    return out;
  }

 private:
  void insert(int level, const Place& p) {
    leaves_[static_cast<std::size_t>(level)].insert(pack(p));
    if (++count_ > most_)
      throw Error(
          ErrorKind::resource,
          "elements of {:.3g} m make more than {} lattice cells; ask for larger ones or fewer surface nodes",
          lattice_.cell, most_);
  }
  // Splits the leaf of a level above `level` that covers the place, down to `level`.
  void split_above(int level, const Place& p) {
    for (int above = level + 1; above <= levels(); ++above) {
      const int up = above - level;
      const Place q{p[0] >> up, p[1] >> up, p[2] >> up};
      if (!leaf(above, q)) continue;
      leaves_[static_cast<std::size_t>(above)].erase(pack(q));
      for (int child = 0; child < 8; ++child)
        insert(above - 1, {2 * q[0] + (child >> 2), 2 * q[1] + (child >> 1 & 1), 2 * q[2] + (child & 1)});
      return split_above(level, p);
    }
  }

  GradedLattice& lattice_;
  std::size_t most_, count_ = 0;
  const std::function<Depth(const Vec3&)>& depth_;
  std::vector<std::unordered_set<std::uint64_t>> leaves_;
};

// Fills the octree with tetrahedra: each joins the centres of two neighbouring leaves, or one centre and a
// shared face.
class Filler {
 public:
  Filler(const Octree& tree, GradedLattice& lattice) : tree_(tree), lattice_(lattice) {
    for (int level = 0; level <= tree_.levels(); ++level)
      for (const Place& p : tree_.sorted(level))
        for (int c = 0; c < 8; ++c)
          corners_.insert(pack({(p[0] + (c >> 2)) << (level + 1), (p[1] + (c >> 1 & 1)) << (level + 1),
                                (p[2] + (c & 1)) << (level + 1)}));
  }

  void fill() {
    for (int level = 0; level <= tree_.levels(); ++level)
      for (const Place& p : tree_.sorted(level))
        for (std::size_t axis = 0; axis < 3; ++axis)
          for (const int side : {0, 1}) face(level, p, axis, side);
  }

 private:
  void face(int level, const Place& p, std::size_t axis, int side) {
    Place next = p;
    next[axis] += 2 * side - 1;
    const Place parent{next[0] >> 1, next[1] >> 1, next[2] >> 1};
    const bool same = tree_.leaf(level, next);
    if (same ? side == 0 : !tree_.leaf(level + 1, parent))
      return;                     // once a pair; larger ones are filled from here
    std::array<Place, 4> corner;  // round the face
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (std::size_t i = 0; i < 4; ++i) {
      Place c = p;
      c[axis] += side, c[u] += i == 1 || i == 2, c[v] += i >= 2;
      corner[i] = {c[0] << (level + 1), c[1] << (level + 1), c[2] << (level + 1)};
    }
    const Place here = Octree::center(level, p);
    if (same)
      between(here, Octree::center(level, next), corner, level == 0);
    else
      against(here, Octree::center(level + 1, parent), corner, std::size_t{u}, v, level);
  }

  // Two leaves of one size: one tetrahedron an edge of their face, two where a smaller leaf divides the edge.
  void between(const Place& a, const Place& b, const std::array<Place, 4>& corner, bool fine) {
    for (std::size_t i = 0; i < 4; ++i) {
      const Place &c = corner[i], &d = corner[(i + 1) % 4];
      const Place middle{(c[0] + d[0]) / 2, (c[1] + d[1]) / 2, (c[2] + d[2]) / 2};
      if (corners_.count(pack(middle)) == 0) {
        add(a, b, c, d, fine);
      } else {
        add(a, b, c, middle, false);
        add(a, b, middle, d, false);
      }
    }
  }

  // A leaf and a larger one: the small one's face is cut from the middle of the large face to its corner.
  void against(const Place& small, const Place& large, const std::array<Place, 4>& corner, std::size_t u,
               std::size_t v, int level) {
    const auto middle = [&](const Place& c) {
      return (c[u] >> (level + 1) & 1) != 0 && (c[v] >> (level + 1) & 1) != 0;
    };
    std::size_t i = 0;
    while (!middle(corner[i])) ++i;
    for (const std::size_t j : {1, 3})
      for (const Place& apex : {small, large})
        add(apex, corner[i], corner[(i + j) % 4], corner[(i + 2) % 4], false);
  }

  Index node(const Place& p) {
    const auto [entry, fresh] = number_.emplace(pack(p), static_cast<Index>(lattice_.nodes.size()));
    if (fresh) lattice_.nodes.push_back(p);
    return entry->second;
  }

  void add(const Place& a, const Place& b, const Place& c, const Place& d, bool fine) {
    const auto way = [&](const Place& to) {
      return std::array<std::int64_t, 3>{to[0] - a[0], to[1] - a[1], to[2] - a[2]};
    };
    const auto x = way(b), y = way(c), z = way(d);
    const std::int64_t volume = x[0] * (y[1] * z[2] - y[2] * z[1]) - x[1] * (y[0] * z[2] - y[2] * z[0]) +
                                x[2] * (y[0] * z[1] - y[1] * z[0]);
    Tetrahedron t{node(a), node(b), node(c), node(d)};
    if (volume < 0) std::swap(t[2], t[3]);
    lattice_.tets.push_back(t);
    lattice_.fine.push_back(fine);
  }

  const Octree& tree_;
  GradedLattice& lattice_;
  std::unordered_set<std::uint64_t> corners_;  // of all leaves
  std::unordered_map<std::uint64_t, Index> number_;
};

}  // namespace

GradedLattice grade_lattice(const Box& box, double cell, int coarsest, std::size_t most_cells,
                            const std::function<Depth(const Vec3&)>& depth, const Progress& progress) {
  GradedLattice lattice;
  lattice.cell = cell;
  const double longest = box.size().maxCoeff() / cell;
  if (!(longest < 1 << 18))
    throw Error(ErrorKind::resource,
                "elements of {:.3g} m are too small for a body of {:.3g} m; ask for a larger spacing", cell,
                box.size().maxCoeff());
  int levels = 0;
  while (levels < coarsest && (4 << levels) < longest) ++levels;
  // Centred, so that a symmetrical body gets a symmetrical mesh.
  lattice.origin = box.center();
  Octree tree(lattice, levels, most_cells, depth);
  Place from, to;
  for (std::size_t a = 0; a < 3; ++a) {
    const double half = (0.5 * box.size()[static_cast<int>(a)] / cell + 1.01) / (1 << levels);
    to[a] = static_cast<std::int32_t>(std::ceil(half)), from[a] = -to[a];
  }
  const double columns = to[0] - from[0];
  for (std::int32_t i = from[0]; i < to[0]; ++i) {
    for (std::int32_t j = from[1]; j < to[1]; ++j)
      for (std::int32_t k = from[2]; k < to[2]; ++k) tree.divide(levels, {i, j, k});
    progress.at((i - from[0] + 1) / columns);
  }
  tree.balance();
  Filler(tree, lattice).fill();
  return lattice;
}

}  // namespace palpate
