// Edges first, then faces, by removing what pierces them. George, Hecht, Saltel, "Automatic mesh generator
// with specified boundary" (1991); Weatherill, Hassan, "Efficient three-dimensional Delaunay triangulation
// with automatic point creation and imposed boundary constraints" (1994).
#include "palpate/pad/recover.hpp"

#include <algorithm>
#include <functional>
#include <optional>

#include "palpate/pad/improve.hpp"

namespace palpate {

namespace {

// Shapes new tetrahedra must have: good ones, else any that are not inverted (what lies in one plane is as
// flat as the joggle).
constexpr double flat = 1e-3;
constexpr double valid = 1e-10;
constexpr std::array<double, 3> floors{1e-2, 1e-4, valid};
constexpr std::array<std::array<std::size_t, 3>, 4> faces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

double orient(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return (b - a).cross(c - a).dot(d - a);
}

// Whether the line from p to q runs through triangle abc, against its normal or with it.
bool line_pierces(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
  const double x = orient(p, q, a, b), y = orient(p, q, b, c), z = orient(p, q, c, a);
  return (x > 0 && y > 0 && z > 0) || (x < 0 && y < 0 && z < 0);
}
bool pierces(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
  const double x = orient(a, b, c, p), y = orient(a, b, c, q);
  return ((x > 0 && y < 0) || (x < 0 && y > 0)) && line_pierces(p, q, a, b, c);
}

class Recoverer {
 public:
  explicit Recoverer(FlipMesh& mesh) : mesh_(mesh) {}

  bool edge(Index u, Index v) {
    mesh_.forget();
    return mesh_.has_edge(u, v) || swap_in(u, v) || flip_in(u, v) || split_in(u, v);
  }

  bool face(Index u, Index v, Index w) {
    mesh_.forget();
    if (mesh_.has_face(u, v, w)) return true;
    const std::array<Edge, 3> sides{{{u, v}, {v, w}, {w, u}}};
    return reduce([&] { return piercing(u, v, w); },
                  [&](const std::vector<Triangle>& edges) {
                    std::vector<Flip> flips;
                    for (const Triangle& e : edges) flips.push_back(e);
                    for (const Triangle& e : edges)
                      for (const Index r : mesh_.ring(e[0], e[1])) flips.push_back({e[0], e[1], r});
                    return flips;
                  },
                  sides) &&
           mesh_.has_face(u, v, w);
  }

 private:
  using Flip = Triangle;  // third -1: remove an edge; else remove a face

  bool apply(const Flip& f, std::span<const Edge> wanted, double floor) {
    if (f[2] >= 0) return mesh_.remove_face(f[0], f[1], f[2], floor);
    return (!wanted.empty() && mesh_.remove_edge(f[0], f[1], floor, wanted)) ||
           mesh_.remove_edge(f[0], f[1], floor);
  }

  bool flip_in(Index u, Index v) {
    const auto flips = [](const std::vector<Triangle>& pierced) {
      std::vector<Flip> result;
      for (const auto& [a, b, c] : pierced)
        for (const Flip& f : {Flip{a, b, c}, Flip{a, b, -1}, Flip{b, c, -1}, Flip{c, a, -1}})
          result.push_back(f);
      return result;
    };
    return reduce([&] { return pierced_by(u, v); }, flips) && mesh_.has_edge(u, v);
  }

  // A new node on an edge in the way, put aside, so that the edge can be flipped away.
  bool split_in(Index u, Index v) {
    const auto pierced = pierced_by(u, v);
    if (!pierced) return false;
    for (const Triangle& f : *pierced)
      for (std::size_t k = 0; k < 3; ++k) {
        const Index a = f[k], b = f[(k + 1) % 3];
        if (mesh_.is_protected(a, b)) continue;
        const Vec3 middle = (mesh_.node(a) + mesh_.node(b)) / 2;
        for (const Index r : mesh_.ring(a, b)) {
          if (r == u || r == v) continue;
          for (const double part : {0.3, 0.6}) {
            const std::size_t before = mesh_.changes();
            const Index n = mesh_.split_edge(a, b, (1 - part) * middle + part * mesh_.node(r));
            if (n < 0) continue;
            bool good = true;
            for (const Index t : mesh_.around(n)) good = good && mesh_.shape_of(mesh_.tet(t)) > valid;
            if (good && flip_in(u, v)) return true;
            mesh_.undo(before);
          }
        }
      }
    return false;
  }

  // Flips as long as the number of crossings falls. True when there is none left.
  template <class Count, class Candidates>
  bool reduce(const Count& count, const Candidates& candidates, std::span<const Edge> wanted = {}) {
    auto crossings = count();
    for (int round = 0; crossings && !crossings->empty() && round < 200; ++round) {
      bool fewer = false;
      for (const double floor : floors) {
        const std::size_t limit = crossings->size();
        fewer = fewer || step(limit, crossings, count, candidates, wanted, floor, 2);
      }
      if (!fewer) return false;
    }
    return crossings && crossings->empty();
  }

  // One flip, or up to `depth` of them, after which there are fewer than `limit` crossings.
  template <class Crossings, class Count, class Candidates>
  bool step(std::size_t limit, Crossings& crossings, const Count& count, const Candidates& candidates,
            std::span<const Edge> wanted, double floor, int depth) {
    for (const Flip& f : candidates(*crossings)) {
      if (!apply(f, wanted, floor)) continue;
      auto now = count();
      if (now && (now->size() < limit || (depth > 1 && now->size() <= limit + 1 &&
                                          step(limit, now, count, candidates, wanted, floor, depth - 1)))) {
        crossings = std::move(now);
        return true;
      }
      mesh_.undo();
    }
    return false;
  }

  // One flip that makes edge uv, if there is one: the other diagonal of a quadrilateral.
  bool swap_in(Index u, Index v) {
    const Edge wanted{u, v};
    std::vector<Triangle> opposite;
    for (const Index t : mesh_.around(u)) {
      std::array<Index, 3> rest{};
      std::size_t n = 0;
      for (const Index x : mesh_.tet(t))
        if (x != u) rest[n++] = x;
      opposite.push_back(rest);
    }
    for (const double floor : floors) {
      for (const auto& [a, b, c] : opposite)
        for (const Edge& e : {Edge{a, b}, Edge{b, c}, Edge{c, a}})
          if (in_ring(v, e) && mesh_.remove_edge(e[0], e[1], floor, {&wanted, 1})) return true;
      for (const auto& [a, b, c] : opposite)
        if (joined(v, a, b, c) && mesh_.remove_face(a, b, c, floor)) return true;
    }
    return false;
  }
  bool in_ring(Index v, const Edge& e) const {
    for (const Index t : mesh_.around(v)) {
      const Tetrahedron& x = mesh_.tet(t);
      if (std::count(x.begin(), x.end(), e[0]) && std::count(x.begin(), x.end(), e[1])) return true;
    }
    return false;
  }
  bool joined(Index v, Index a, Index b, Index c) const {
    for (const Index t : mesh_.around(v)) {
      const Tetrahedron& x = mesh_.tet(t);
      if (std::count(x.begin(), x.end(), a) && std::count(x.begin(), x.end(), b) &&
          std::count(x.begin(), x.end(), c))
        return true;
    }
    return false;
  }

  // The faces that segment uv pierces, in order; none when the walk loses its way.
  std::optional<std::vector<Triangle>> pierced_by(Index u, Index v) const {
    std::vector<Triangle> result;
    if (mesh_.has_edge(u, v)) return result;
    const Vec3 &p = mesh_.node(u), &q = mesh_.node(v);
    Index t = -1;
    for (const Index s : mesh_.around(u)) {
      const Tetrahedron& x = mesh_.tet(s);
      const auto corner = static_cast<std::size_t>(std::find(x.begin(), x.end(), u) - x.begin());
      const Triangle f{x[faces[corner][0]], x[faces[corner][1]], x[faces[corner][2]]};
      if (!pierces(p, q, mesh_.node(f[0]), mesh_.node(f[1]), mesh_.node(f[2]))) continue;
      result.push_back(f);
      t = mesh_.below(f[0], f[2], f[1]);
      break;
    }
    while (t >= 0 && result.size() < 1000) {
      const Tetrahedron& x = mesh_.tet(t);
      if (std::count(x.begin(), x.end(), v)) return result;
      const Triangle entry = result.back();
      Index next = -1;
      for (const auto& [i, j, k] : faces) {
        const Triangle f{x[i], x[j], x[k]};
        if (std::is_permutation(f.begin(), f.end(), entry.begin())) continue;
        if (!line_pierces(p, q, mesh_.node(f[0]), mesh_.node(f[1]), mesh_.node(f[2]))) continue;
        result.push_back(f);
        next = mesh_.below(f[0], f[2], f[1]);
        break;
      }
      t = next;
    }
    return {};
  }

  // The edges that pierce triangle uvw, as (a, b, -1).
  std::optional<std::vector<Triangle>> piercing(Index u, Index v, Index w) const {
    std::vector<Triangle> result;
    if (mesh_.has_face(u, v, w)) return result;
    std::vector<Index> todo;
    for (const Index x : {u, v, w}) todo.insert(todo.end(), mesh_.around(x).begin(), mesh_.around(x).end());
    std::vector<Index> seen;
    for (std::size_t i = 0; i < todo.size() && i < 5000; ++i) {
      if (std::find(seen.begin(), seen.end(), todo[i]) != seen.end()) continue;
      seen.push_back(todo[i]);
      const Tetrahedron& x = mesh_.tet(todo[i]);
      for (std::size_t j = 0; j < 4; ++j)
        for (std::size_t k = j + 1; k < 4; ++k) {
          const Triangle e{std::min(x[j], x[k]), std::max(x[j], x[k]), -1};
          if (e[0] == u || e[0] == v || e[0] == w || e[1] == u || e[1] == v || e[1] == w) continue;
          if (std::find(result.begin(), result.end(), e) != result.end()) continue;
          if (!pierces(mesh_.node(e[0]), mesh_.node(e[1]), mesh_.node(u), mesh_.node(v), mesh_.node(w)))
            continue;
          result.push_back(e);
          for (const Index t : mesh_.around(e[0])) {
            const Tetrahedron& y = mesh_.tet(t);
            if (std::count(y.begin(), y.end(), e[1])) todo.push_back(t);
          }
        }
    }
    if (result.empty()) return {};
    return result;
  }

  FlipMesh& mesh_;
};

}  // namespace

Recovery recover(FlipMesh& mesh, std::span<const Triangle> triangles) {
  Recoverer recoverer(mesh);
  Recovery report;
  std::vector<Edge> edges;
  for (const Triangle& t : triangles)
    for (std::size_t k = 0; k < 3; ++k)
      edges.push_back({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])});
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  const auto settle_edges = [&](bool by_flips) {
    std::vector<Edge> left;
    for (const auto& [a, b] : edges) {
      if (by_flips ? recoverer.edge(a, b) : mesh.has_edge(a, b))
        mesh.protect_edge(a, b);
      else
        left.push_back({a, b});
    }
    edges.swap(left);
    return left.size() - edges.size();
  };
  std::vector<Triangle> rest(triangles.begin(), triangles.end());
  const auto settle_faces = [&](bool by_flips) {
    std::vector<Triangle> left;
    for (const auto& t : rest) {
      if (by_flips ? recoverer.face(t[0], t[1], t[2]) : mesh.has_face(t[0], t[1], t[2]))
        mesh.protect_face(t[0], t[1], t[2]);
      else
        left.push_back(t);
    }
    rest.swap(left);
    return left.size() - rest.size();
  };
  settle_edges(false), settle_faces(false);
  flip_out(mesh, flat);
  settle_edges(false);
  report.edges_absent = edges.size();
  while (!edges.empty() && settle_edges(true)) {
  }
  settle_faces(false);
  report.faces_absent = rest.size();
  while (!rest.empty() && settle_faces(true) + settle_edges(true)) {
  }
  report.edges_missing = edges.size(), report.faces_missing = rest.size();
  return report;
}

}  // namespace palpate
