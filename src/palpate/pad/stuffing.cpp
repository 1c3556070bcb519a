#include "palpate/pad/stuffing.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "palpate/pad/stencils.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// How near, in edge lengths, a cut comes to a node before the node is moved onto it: along the edges of the
// cubes, and along those from corners to centres (table 1 of the paper: angles from 10.7 to 164.8 degrees).
constexpr double near_long = 0.24999, near_short = 0.41189;
const double most_cosine = std::cos(11 * M_PI / 180), least_cosine = std::cos(164 * M_PI / 180);
constexpr std::size_t most_cells = 20000000;
constexpr int coarsest = 6;

struct Edge {
  Index a = 0, b = 0;  // a inside, b outside
  double t = 0;        // the cut: a + t (b - a)
  Index node = -1;     // made there
};

class Stuffing {
 public:
  Stuffing(const SignedDistanceField& outer, const std::vector<SignedDistanceField>& inner,
           const GradedLattice& lattice)
      : outer_(outer), inner_(inner), lattice_(lattice) {}

  Stuffed run(std::size_t parts, const Progress& progress) {
    sample();
    find_edges();
    progress.at(0.6);
    keep_.assign(lattice_.nodes.size(), 0);
    for (;;) {
      warp();
      cut_all();
      progress.at(0.8);
      drop_islands(parts);
      const std::vector<Index> pinched = pinches();
      if (pinched.empty()) break;
      for (const Index v : pinched) keep_[at(v)] = 1;
    }
    result_.kept = static_cast<std::size_t>(std::count(keep_.begin(), keep_.end(), 1));
    for (std::size_t s = 0; s < inner_.size(); ++s) meet(s);
    collect();
    return std::move(result_);
  }

 private:
  bool is_long(Index a, Index b) const {
    const auto &x = lattice_.nodes[at(a)], &y = lattice_.nodes[at(b)];
    return (x[0] == y[0]) + (x[1] == y[1]) + (x[2] == y[2]) == 2;
  }
  double near(const Edge& e) const { return is_long(e.a, e.b) ? near_long : near_short; }

  void sample() {
    inside_.resize(lattice_.nodes.size());
    SignedDistance last;
    for (std::size_t i = 0; i < inside_.size(); ++i) {
      last = outer_.at(lattice_.position(static_cast<Index>(i)), std::numeric_limits<double>::infinity(),
                       last.triangle);
      inside_[i] = last.distance < 0;
    }
  }

  // Where the surface cuts the edges, by the Illinois method (Dowell, Jarratt 1971).
  double cut(Index a, Index b) const {
    const Vec3 from = lattice_.position(a), way = lattice_.position(b) - from;
    double low = 0, high = 1;
    SignedDistance s = outer_.at(from);
    double f_low = s.distance;
    double f_high = outer_.at(from + way, std::numeric_limits<double>::infinity(), s.triangle).distance;
    double t = 0;
    int side = 0;
    for (int i = 0; i < 40; ++i) {
      t = f_high > f_low ? (low * f_high - high * f_low) / (f_high - f_low) : 0.5 * (low + high);
      s = outer_.at(from + t * way, std::numeric_limits<double>::infinity(), s.triangle);
      if (std::abs(s.distance) < 1e-6 * lattice_.cell || high - low < 1e-9) break;
      if (s.distance < 0) {
        low = t, f_low = s.distance;
        if (side == -1) f_high *= 0.5;
        side = -1;
      } else {
        high = t, f_high = s.distance;
        if (side == 1) f_low *= 0.5;
        side = 1;
      }
    }
    return t;
  }

  void find_edges() {
    for (std::size_t i = 0; i < lattice_.tets.size(); ++i) {
      const Tetrahedron& t = lattice_.tets[i];
      int in = 0;
      for (const Index v : t) in += inside_[at(v)];
      if (in == 0 || in == 4) continue;
      if (!lattice_.fine[i])
        throw Error(
            ErrorKind::geometry,
            "the sign of the distance changes far from the surface, near ({:.6g}, {:.6g}, {:.6g}): is it "
            "open? close its holes",
            lattice_.position(t[0]).x(), lattice_.position(t[0]).y(), lattice_.position(t[0]).z());
      for (const Index a : t)
        for (const Index b : t)
          if (inside_[at(a)] && !inside_[at(b)] &&
              edge_.emplace(key(a, b), static_cast<Index>(edges_.size())).second)
            edges_.push_back({a, b});
    }
    for (Edge& e : edges_) e.t = cut(e.a, e.b);
    first_.assign(lattice_.nodes.size() + 1, 0);
    for (const Edge& e : edges_) ++first_[at(e.a) + 1], ++first_[at(e.b) + 1];
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    of_.resize(2 * edges_.size());
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    find_tets_of_nodes();
    for (std::size_t i = 0; i < edges_.size(); ++i)
      of_[next[at(edges_[i].a)]++] = of_[next[at(edges_[i].b)]++] = static_cast<Index>(i);
  }
  void find_tets_of_nodes() {
    first_tet_.assign(lattice_.nodes.size() + 1, 0);
    for (const Tetrahedron& t : lattice_.tets)
      for (const Index v : t) ++first_tet_[at(v) + 1];
    std::partial_sum(first_tet_.begin(), first_tet_.end(), first_tet_.begin());
    tet_of_.resize(4 * lattice_.tets.size());
    std::vector<std::size_t> next(first_tet_.begin(), first_tet_.end() - 1);
    for (std::size_t i = 0; i < lattice_.tets.size(); ++i)
      for (const Index v : lattice_.tets[i]) tet_of_[next[at(v)]++] = static_cast<Index>(i);
  }
  // Whether a node is the last of its sign: a part or a cavity smaller than a cell would be lost with it.
  bool alone(std::size_t v) const {
    for (std::size_t i = first_tet_[v]; i < first_tet_[v + 1]; ++i)
      for (const Index w : lattice_.tets[at(tet_of_[i])])
        if (at(w) != v && sign_[at(w)] == sign_[v]) return false;
    return true;
  }
  static std::uint64_t key(Index a, Index b) {
    return static_cast<std::uint64_t>(a) << 32 | static_cast<std::uint32_t>(b);
  }

  bool crossed(const Edge& e) const { return sign_[at(e.a)] > 0 && sign_[at(e.b)] < 0; }

  // Moves each node that a cut comes near to onto the nearest cut.
  void warp() {
    const std::size_t n = lattice_.nodes.size();
    sign_.resize(n), place_.resize(n);
    for (std::size_t v = 0; v < n; ++v)
      sign_[v] = inside_[v] ? 1 : -1, place_[v] = lattice_.position(static_cast<Index>(v));
    for (std::size_t v = 0; v < n; ++v) {
      if (keep_[v]) continue;
      double nearest = std::numeric_limits<double>::infinity();
      for (std::size_t i = first_[v]; i < first_[v + 1]; ++i) {
        const Edge& e = edges_[at(of_[i])];
        if (!crossed(e)) continue;
        const double t = at(e.a) == v ? e.t : 1 - e.t;
        const Vec3 from = lattice_.position(static_cast<Index>(v)),
                   to = lattice_.position(at(e.a) == v ? e.b : e.a);
        const double distance = t * (to - from).norm();
        if (t < near(e) && distance < nearest) nearest = distance, place_[v] = from + t * (to - from);
      }
      if (nearest < std::numeric_limits<double>::infinity() && !alone(v))
        sign_[v] = 0;
      else
        place_[v] = lattice_.position(static_cast<Index>(v));
    }
  }

  // From nodes that were kept in place the surface keeps its distance, for the angles' sake.
  void cut_all() {
    place_.resize(lattice_.nodes.size());
    for (Edge& e : edges_) {
      e.node = -1;
      if (!crossed(e)) continue;
      const double t = std::clamp(e.t, near(e), 1 - near(e));
      e.node = static_cast<Index>(place_.size());
      place_.push_back(place_[at(e.a)] + t * (place_[at(e.b)] - place_[at(e.a)]));
    }
    const Cutter cutter{[&](Index v) { return int(sign_[at(v)]); },
                        [&](Index a, Index b) { return edges_[at(edge_.at(key(a, b)))].node; },
                        [&](Index a, Index b, Index c) { return from_first(a, b, c); },
                        [&](Index v) { return place_[at(v)]; }};
    tets_.clear();
    for (const Tetrahedron& t : lattice_.tets) fill(t, cutter, tets_);
  }

  // The diagonal meets the cut of the long edge; where that is the edge inside, it starts from the end with
  // the even place, whichever the face.
  bool from_first(Index a, Index b, Index c) const {
    if (is_long(b, c)) return true;
    if (is_long(a, c)) return false;
    const auto &x = lattice_.nodes[at(a)], &y = lattice_.nodes[at(b)];
    for (std::size_t k = 0; k < 3; ++k)
      if (x[k] != y[k]) return (x[k] >> 1 & 1) == 0;
    return true;
  }

  void drop_islands(std::size_t parts);
  std::vector<Index> pinches() const;
  void meet(std::size_t surface);
  bool good_about(std::size_t v) const;
  void collect();

  const SignedDistanceField& outer_;
  const std::vector<SignedDistanceField>& inner_;
  const GradedLattice& lattice_;
  std::vector<char> inside_, keep_;  // of each lattice node
  std::vector<signed char> sign_;    // after warping: 1, 0, -1
  std::vector<Vec3> place_;          // of all nodes, those made by cuts after the lattice's
  std::vector<Edge> edges_;          // that the surface cuts
  std::unordered_map<std::uint64_t, Index> edge_;
  std::vector<std::size_t> first_;  // of_[first_[v] .. first_[v + 1]]: the edges of lattice node v
  std::vector<Index> of_;
  std::vector<std::size_t> first_tet_;
  std::vector<Index> tet_of_;      // of each lattice node, the same way
  std::vector<Tetrahedron> tets_;  // what is left
  std::vector<Index> region_;      // of each
  std::vector<char> moved_;        // lattice nodes, onto an inner surface
  Stuffed result_;
};

struct Face {
  std::array<Index, 3> v;  // ascending
  Index tet;
};
std::vector<Face> sorted_faces(const std::vector<Tetrahedron>& tets) {
  std::vector<Face> faces;
  faces.reserve(4 * tets.size());
  for (std::size_t i = 0; i < tets.size(); ++i)
    for (std::size_t f = 0; f < 4; ++f) {
      Face x{{tets[i][(f + 1) % 4], tets[i][(f + 2) % 4], tets[i][(f + 3) % 4]}, static_cast<Index>(i)};
      std::sort(x.v.begin(), x.v.end());
      faces.push_back(x);
    }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.v < b.v; });
  return faces;
}

// Roots in a forest of numbers (Tarjan 1975, path halving).
class Forest {
 public:
  explicit Forest(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0); }
  Index root(Index i) {
    while (parent_[at(i)] != i) i = parent_[at(i)] = parent_[at(parent_[at(i)])];
    return i;
  }
  void join(Index a, Index b) {
    a = root(a), b = root(b);
    parent_[at(std::max(a, b))] = std::min(a, b);
  }

 private:
  std::vector<Index> parent_;
};

// Parts hang together by faces.
void Stuffing::drop_islands(std::size_t parts) {
  result_.islands = 0, result_.islands_volume = 0;
  const std::vector<Face> faces = sorted_faces(tets_);
  Forest forest(tets_.size());
  for (std::size_t i = 1; i < faces.size(); ++i)
    if (faces[i].v == faces[i - 1].v) forest.join(faces[i - 1].tet, faces[i].tet);
  std::vector<double> volume(tets_.size(), 0);
  for (std::size_t i = 0; i < tets_.size(); ++i) {
    const Tetrahedron& t = tets_[i];
    const Vec3& a = place_[at(t[0])];
    volume[at(forest.root(static_cast<Index>(i)))] +=
        (place_[at(t[1])] - a).cross(place_[at(t[2])] - a).dot(place_[at(t[3])] - a) / 6;
  }
  std::vector<Index> largest;
  for (std::size_t i = 0; i < tets_.size(); ++i)
    if (forest.root(static_cast<Index>(i)) == static_cast<Index>(i)) largest.push_back(static_cast<Index>(i));
  std::stable_sort(largest.begin(), largest.end(),
                   [&](Index a, Index b) { return volume[at(a)] > volume[at(b)]; });
  const double debris = 8 * std::pow(lattice_.cell, 3);
  while (largest.size() > parts && volume[at(largest.back())] < debris) {
    ++result_.islands, result_.islands_volume += volume[at(largest.back())];
    largest.pop_back();
  }
  std::vector<char> wanted(tets_.size(), 0);
  for (const Index root : largest) wanted[at(root)] = 1;
  std::vector<Tetrahedron> rest;
  for (std::size_t i = 0; i < tets_.size(); ++i)
    if (wanted[at(forest.root(static_cast<Index>(i)))]) rest.push_back(tets_[i]);
  tets_ = std::move(rest);
}

// Warped nodes about which the boundary is no disk: more than two of its faces meet at an edge, or several
// fans at a node.
std::vector<Index> Stuffing::pinches() const {
  const std::vector<Face> faces = sorted_faces(tets_);
  struct Spoke {  // an edge of a boundary face
    Index a, b;   // ascending
    Index face;
  };
  std::vector<Spoke> spokes;
  std::vector<Index> corner;  // of the boundary faces, three each
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if ((i > 0 && faces[i - 1].v == faces[i].v) || (i + 1 < faces.size() && faces[i + 1].v == faces[i].v))
      continue;
    const auto face = static_cast<Index>(corner.size() / 3);
    const auto& v = faces[i].v;
    corner.insert(corner.end(), v.begin(), v.end());
    spokes.push_back({v[0], v[1], face});
    spokes.push_back({v[0], v[2], face});
    spokes.push_back({v[1], v[2], face});
  }
  std::sort(spokes.begin(), spokes.end(), [](const Spoke& x, const Spoke& y) {
    return std::tie(x.a, x.b, x.face) < std::tie(y.a, y.b, y.face);
  });
  std::vector<Index> found;
  const auto suspect = [&](Index v) {
    if (at(v) < lattice_.nodes.size() && sign_[at(v)] == 0) found.push_back(v);
  };
  const auto corner_at = [&](Index face, Index v) {
    const std::size_t i = 3 * at(face);
    return static_cast<Index>(corner[i] == v ? i : corner[i + 1] == v ? i + 1 : i + 2);
  };
  Forest fans(corner.size());  // corners at one node, joined across edges
  for (std::size_t i = 0, end = 0; i < spokes.size(); i = end) {
    for (end = i; end < spokes.size() && spokes[end].a == spokes[i].a && spokes[end].b == spokes[i].b;) ++end;
    for (const Index v : {spokes[i].a, spokes[i].b}) {
      if (end - i != 2) suspect(v);
      for (std::size_t j = i + 1; j < end; ++j)
        fans.join(corner_at(spokes[i].face, v), corner_at(spokes[j].face, v));
    }
  }
  std::vector<Index> fan(place_.size(), -1);
  for (std::size_t i = 0; i < corner.size(); ++i) {
    const Index root = fans.root(static_cast<Index>(i));
    Index& known = fan[at(corner[i])];
    if (known >= 0 && known != root) suspect(corner[i]);
    known = root;
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

// Moves nodes near an inner surface onto it, where nothing is cut, and labels what is in it.
void Stuffing::meet(std::size_t surface) {
  const SignedDistanceField& field = inner_[surface];
  const std::size_t n = lattice_.nodes.size();
  const auto region = static_cast<Index>(surface + 1);
  if (region_.empty()) region_.assign(tets_.size(), 0), moved_.assign(n, 0);
  std::vector<double> d(place_.size(), std::numeric_limits<double>::quiet_NaN());
  const auto distance = [&](Index v) {
    if (std::isnan(d[at(v)])) d[at(v)] = field.at(place_[at(v)]).distance;
    return d[at(v)];
  };
  std::vector<Vec3> target(n);
  std::vector<double> nearest(n, std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < lattice_.tets.size(); ++i) {
    const Tetrahedron& t = lattice_.tets[i];
    if (!std::all_of(t.begin(), t.end(), [&](Index v) { return sign_[at(v)] > 0; })) continue;
    for (const Index a : t)
      for (const Index b : t) {
        if (!((distance(a) < 0) != (distance(b) < 0)) || moved_[at(a)] || moved_[at(b)]) continue;
        // The distance is almost linear over a cell: from the crossing to the surface is a small step.
        const double s = std::abs(distance(a)) / (std::abs(distance(a)) + std::abs(distance(b)));
        const double length = (place_[at(b)] - place_[at(a)]).norm();
        if (s < (is_long(a, b) ? near_long : near_short) && s * length < nearest[at(a)])
          nearest[at(a)] = s * length, target[at(a)] = place_[at(a)] + s * (place_[at(b)] - place_[at(a)]);
      }
  }
  for (std::size_t v = 0; v < n; ++v) {
    if (!(nearest[v] < std::numeric_limits<double>::infinity()) || first_[v] != first_[v + 1]) continue;
    const Vec3 before = std::exchange(place_[v], target[v]);
    if (good_about(v))
      moved_[v] = 1, d[v] = 0;
    else
      place_[v] = before;
  }
  for (std::size_t i = 0; i < tets_.size(); ++i) {
    Vec3 middle = Vec3::Zero();
    for (const Index v : tets_[i]) middle += place_[at(v)] / 4;
    if (field.at(middle).distance < 0) region_[i] = region;
  }
}

// Whether the lattice's tetrahedra at a node, none of them cut, keep to the bounds of the angles.
bool Stuffing::good_about(std::size_t v) const {
  for (std::size_t i = first_tet_[v]; i < first_tet_[v + 1]; ++i) {
    const Tetrahedron& t = lattice_.tets[at(tet_of_[i])];
    std::array<Vec3, 4> normal;  // outwards
    for (std::size_t f = 0; f < 4; ++f) {
      const Vec3 &x = place_[at(t[(f + 1) % 4])], &y = place_[at(t[(f + 2) % 4])],
                 &z = place_[at(t[(f + 3) % 4])];
      normal[f] = (y - x).cross(z - x).normalized();
      const double height = normal[f].dot(place_[at(t[f])] - x);
      if (!(std::abs(height) > 1e-6 * lattice_.cell)) return false;
      if (height > 0) normal[f] = -normal[f];
    }
    for (std::size_t f = 0; f < 4; ++f)
      for (std::size_t g = 0; g < f; ++g)
        if (const double cosine = -normal[f].dot(normal[g]); cosine > most_cosine || cosine < least_cosine)
          return false;
  }
  return true;
}

void Stuffing::collect() {
  region_.resize(tets_.size(), 0);
  std::vector<Index> order(tets_.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return region_[at(a)] < region_[at(b)]; });
  std::vector<Index> number(place_.size(), -1);
  result_.warped = result_.cut = 0;
  for (const Index i : order) {
    Tetrahedron t = tets_[at(i)];
    for (Index& v : t) {
      if (number[at(v)] < 0) {
        number[at(v)] = static_cast<Index>(result_.mesh.nodes.size());
        result_.mesh.nodes.push_back(place_[at(v)]);
        if (at(v) >= lattice_.nodes.size())
          ++result_.cut;
        else
          result_.warped += sign_[at(v)] == 0;
      }
      v = number[at(v)];
    }
    result_.mesh.tets.push_back(t);
    result_.mesh.regions.push_back(region_[at(i)]);
  }
}

}  // namespace

Stuffed stuff(const SignedDistanceField& outer, const std::vector<SignedDistanceField>& inner, const Box& box,
              double cell, std::size_t parts, bool grade, const Progress& progress) {
  if (!(cell > 0) || !std::isfinite(cell)) throw Error(ErrorKind::usage, "the element size must be positive");
  const auto depth = [&](const Vec3& p) {
    const double d = outer.at(p).distance;
    Depth out{d, std::abs(d)};
    for (const SignedDistanceField& s : inner)
      out.nearest = std::min(out.nearest, std::abs(s.at(p).distance));
    return out;
  };
  const GradedLattice lattice = grade_lattice(box, cell, grade ? coarsest : 0, most_cells, depth, progress);
  return Stuffing(outer, inner, lattice).run(parts, progress);
}

}  // namespace palpate
