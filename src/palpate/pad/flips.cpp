#include "palpate/pad/flips.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

constexpr std::size_t largest_ring = 14;  // the cost of a ring grows with its cube

bool holds(const Tetrahedron& t, Index v) { return t[0] == v || t[1] == v || t[2] == v || t[3] == v; }

Triangle sorted(Index a, Index b, Index c) {
  Triangle t{a, b, c};
  std::sort(t.begin(), t.end());
  return t;
}

// The other two corners c, d of a tetrahedron with edge ab, so that (a, b, c, d) is oriented as it is.
Edge opposite(const Tetrahedron& t, Index a, Index b) {
  std::array<Index, 4> order{a, b, -1, -1};
  std::size_t n = 2;
  for (const Index v : t)
    if (v != a && v != b) order[n++] = v;
  bool even = true;  // parity of the permutation from t to order
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = i + 1; j < 4; ++j) {
      const auto at = [&](Index v) { return std::find(t.begin(), t.end(), v); };
      if (at(order[i]) > at(order[j])) even = !even;
    }
  return even ? Edge{order[2], order[3]} : Edge{order[3], order[2]};
}

}  // namespace

double shape(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const Vec3 ab = b - a, ac = c - a, ad = d - a, bc = c - b, bd = d - b;
  const Vec3 n = ab.cross(ac);
  const double six_volume = n.dot(ad);
  // Squared lengths of edge ij and squared double areas of the faces opposite corner k; the dihedral angle at
  // an edge has the sine 6 V l / (2A 2A).
  const double ab2 = ab.squaredNorm(), ac2 = ac.squaredNorm(), ad2 = ad.squaredNorm(), bc2 = bc.squaredNorm(),
               bd2 = bd.squaredNorm(), cd2 = (d - c).squaredNorm();
  const double longest2 = std::max({ab2, ac2, ad2, bc2, bd2, cd2});
  const double volume_of_cube = longest2 * std::sqrt(longest2);
  if (!(six_volume > 1e-15 * volume_of_cube)) return std::min(six_volume / (volume_of_cube + 1e-300), 0.0);
  const double A2 = bc.cross(bd).squaredNorm(), B2 = ac.cross(ad).squaredNorm(),
               C2 = ab.cross(ad).squaredNorm(), D2 = n.squaredNorm();
  const double least =
      std::min({ab2 * A2 * B2, ac2 * A2 * C2, ad2 * A2 * D2, bc2 * B2 * C2, bd2 * B2 * D2, cd2 * C2 * D2});
  // ab2 A2 B2 / (A2 B2 C2 D2) = ab2 / (C2 D2)
  return six_volume * std::sqrt(least / (A2 * B2) / (C2 * D2));
}

FlipMesh::FlipMesh(std::vector<Vec3> nodes_, std::span<const Tetrahedron> tets)
    : nodes(std::move(nodes_)),
      labels(tets.size(), 0),
      tets_(tets.begin(), tets.end()),
      around_(nodes.size()) {
  for (std::size_t t = 0; t < tets_.size(); ++t)
    for (const Index v : tets_[t]) around_[static_cast<std::size_t>(v)].push_back(static_cast<Index>(t));
}

std::size_t FlipMesh::FaceHash::operator()(const Triangle& t) const {
  std::uint64_t h = 0;
  for (const Index v : t) h = (h ^ static_cast<std::uint64_t>(v)) * 0x9e3779b97f4a7c15u, h ^= h >> 32;
  return h;
}

bool FlipMesh::has_edge(Index a, Index b) const {
  for (const Index t : around(a))
    if (holds(tet(t), b)) return true;
  return false;
}

Index FlipMesh::below(Index a, Index b, Index c) const {
  for (const Index t : around(a)) {
    if (!holds(tet(t), b) || !holds(tet(t), c)) continue;
    // (a, b, c, d) positive has the face (a, c, b) facing outwards.
    if (opposite(tet(t), a, c)[0] == b) return t;
  }
  return -1;
}

void FlipMesh::protect_edge(Index a, Index b) { edges_.insert(edge_key(a, b)); }

void FlipMesh::protect_face(Index a, Index b, Index c) {
  faces_.insert(sorted(a, b, c));
  protect_edge(a, b), protect_edge(b, c), protect_edge(c, a);
}

std::vector<Index> FlipMesh::ring(Index a, Index b) const {
  std::array<Edge, 64> links;
  std::size_t n = 0;
  for (const Index t : around(a))
    if (holds(tet(t), b)) {
      if (n == links.size()) return {};
      links[n++] = opposite(tet(t), a, b);
    }
  std::vector<Index> result;
  if (n < 3) return result;
  Index v = links[0][0];
  for (std::size_t i = 0; i < n; ++i) {
    const auto link =
        std::find_if(links.begin(), links.begin() + n, [&](const Edge& e) { return e[0] == v; });
    if (link == links.begin() + n) return {};
    result.push_back(v);
    v = (*link)[1];
    if (v == result[0] && i + 1 < n) return {};  // two rings: not a mesh here
  }
  if (v != result[0]) result.clear();
  return result;
}

void FlipMesh::kill(Index t) {
  for (const Index v : tet(t)) {
    auto& list = around_[static_cast<std::size_t>(v)];
    const auto entry = std::find(list.begin(), list.end(), t);
    *entry = list.back();
    list.pop_back();
  }
  tets_[static_cast<std::size_t>(t)] = {-1, -1, -1, -1};
  free_.push_back(t);
}

Index FlipMesh::add(const Tetrahedron& t, Index label) {
  Index number = static_cast<Index>(tets_.size());
  if (free_.empty()) {
    tets_.push_back(t), labels.push_back(label);
  } else {
    number = free_.back();
    free_.pop_back();
    tets_[static_cast<std::size_t>(number)] = t, labels[static_cast<std::size_t>(number)] = label;
  }
  for (const Index v : t) around_[static_cast<std::size_t>(v)].push_back(number);
  return number;
}

void FlipMesh::replace(std::span<const Index> old, std::span<const Tetrahedron> fresh, bool made_node) {
  Change change{{}, {}, labels[static_cast<std::size_t>(old[0])], tets_.size(), made_node};
  for (const Index t : old) change.removed.push_back(tet(t)), kill(t);
  for (const Tetrahedron& t : fresh) change.added.push_back(add(t, change.label));
  journal_.push_back(std::move(change));
}

// Exactly backwards, so that each tetrahedron gets its number again: earlier changes in the journal go by
// them.
void FlipMesh::undo() {
  const Change change = std::move(journal_.back());
  journal_.pop_back();
  for (auto t = change.added.rbegin(); t != change.added.rend(); ++t) {
    kill(*t);
    if (static_cast<std::size_t>(*t) >= change.slots) free_.pop_back(), tets_.pop_back(), labels.pop_back();
  }
  for (auto t = change.removed.rbegin(); t != change.removed.rend(); ++t) add(*t, change.label);
  if (change.made_node) nodes.pop_back(), around_.pop_back();
}

bool FlipMesh::remove_edge(Index a, Index b, double floor, std::span<const Edge> wanted) {
  if (is_protected(a, b)) return false;
  const std::vector<Index> r = ring(a, b);
  const std::size_t m = r.size();
  if (m < 3 || m > largest_ring) return false;
  if (m == 3 && has_face(r[0], r[1], r[2])) return false;
  std::array<Index, largest_ring> old;
  std::size_t olds = 0;
  double worst = 2;
  for (const Index t : around(a))
    if (holds(tet(t), b)) old[olds++] = t, worst = std::min(worst, shape_of(tet(t)));
  if (floor == improve) floor = worst + 1e-6 + 0.01 * std::abs(worst);

  // Places of the wanted edges in the ring.
  std::vector<std::array<std::size_t, 2>> keep;
  for (const Edge& e : wanted) {
    const auto i = static_cast<std::size_t>(std::find(r.begin(), r.end(), e[0]) - r.begin());
    const auto j = static_cast<std::size_t>(std::find(r.begin(), r.end(), e[1]) - r.begin());
    if (i == m || j == m) return false;
    keep.push_back({std::min(i, j), std::max(i, j)});
  }
  const auto allowed = [&](std::size_t i, std::size_t j) {  // chord i < j
    if (j == i + 1 || (i == 0 && j + 1 == m)) return true;
    for (const auto& [x, y] : keep)
      if ((x > i && x < j && (y < i || y > j)) || (y > i && y < j && (x < i || x > j))) return false;
    return !has_edge(r[i], r[j]);
  };
  // best[i][j]: smallest shape of the best triangulation of the polygon r[i..j], apex[i][j] of its chord.
  std::array<std::array<double, largest_ring>, largest_ring> best;
  std::array<std::array<std::size_t, largest_ring>, largest_ring> apex{};
  for (std::size_t i = 0; i + 1 < m; ++i) best[i][i + 1] = 2;
  for (std::size_t width = 2; width < m; ++width)
    for (std::size_t i = 0; i + width < m; ++i) {
      const std::size_t j = i + width;
      best[i][j] = -1;
      if (!allowed(i, j)) continue;
      for (std::size_t k = i + 1; k < j; ++k) {
        double q = std::min(best[i][k], best[k][j]);
        if (q <= floor || q <= best[i][j]) continue;
        q = std::min(q, shape(node(r[i]), node(r[k]), node(r[j]), node(b)));
        if (q <= floor || q <= best[i][j]) continue;
        q = std::min(q, shape(node(r[k]), node(r[i]), node(r[j]), node(a)));
        if (q > best[i][j]) best[i][j] = q, apex[i][j] = k;
      }
    }
  if (!(best[0][m - 1] > floor)) return false;
  std::vector<Tetrahedron> fresh;
  const std::function<void(std::size_t, std::size_t)> emit = [&](std::size_t i, std::size_t j) {
    if (j == i + 1) return;
    const std::size_t k = apex[i][j];
    fresh.push_back({r[i], r[k], r[j], b});
    fresh.push_back({r[k], r[i], r[j], a});
    emit(i, k), emit(k, j);
  };
  emit(0, m - 1);
  replace(std::span<const Index>(old.data(), olds), fresh);
  return true;
}

bool FlipMesh::remove_face(Index a, Index b, Index c, double floor) {
  if (faces_.count(sorted(a, b, c))) return false;
  const std::array<Index, 2> old{below(a, b, c), below(a, c, b)};
  if (old[0] < 0 || old[1] < 0) return false;
  const auto apex = [&](Index t) {
    for (const Index v : tet(t))
      if (v != a && v != b && v != c) return v;
    return Index{-1};
  };
  // Seen from s the face is counter-clockwise.
  const Index s = apex(old[1]), t = apex(old[0]);
  if (s == t || has_edge(s, t)) return false;
  if (floor == improve) {
    floor = std::min(shape_of(tet(old[0])), shape_of(tet(old[1])));
    floor += 1e-6 + 0.01 * std::abs(floor);
  }
  const std::array<Tetrahedron, 3> fresh{{{t, s, a, b}, {t, s, b, c}, {t, s, c, a}}};
  for (const Tetrahedron& n : fresh)
    if (!(shape_of(n) > floor)) return false;
  replace(old, fresh);
  return true;
}

Index FlipMesh::split_edge(Index a, Index b, const Vec3& p) {
  if (is_protected(a, b)) return -1;
  const std::vector<Index> r = ring(a, b);
  if (r.empty()) return -1;
  const auto v = static_cast<Index>(nodes.size());
  nodes.push_back(p);
  around_.resize(nodes.size());
  std::vector<Index> old;
  std::vector<Tetrahedron> fresh;
  for (const Index t : around(a))
    if (holds(tet(t), b)) old.push_back(t);
  for (std::size_t i = 0; i < r.size(); ++i) {
    const Index c = r[i], d = r[(i + 1) % r.size()];
    fresh.push_back({a, v, c, d}), fresh.push_back({v, b, c, d});
  }
  replace(old, fresh, true);
  return v;
}

}  // namespace palpate
