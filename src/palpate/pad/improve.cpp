// Flips and moves, worst tetrahedron first, each accepted only if the worst one it touches gets better.
// Freitag, Ollivier-Gooch, "Tetrahedral mesh improvement using swapping and smoothing" (1997); Klingner,
// Shewchuk, "Aggressive tetrahedral mesh improvement" (2007).
#include "palpate/pad/improve.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

constexpr int most_rounds = 12;
const double bad_shape = std::sin(8 * M_PI / 180);  // worth two flips or a new node

class Improver {
 public:
  Improver(FlipMesh& mesh, Index first_free) : mesh_(mesh), first_free_(first_free) {}

  bool flip(Index t) {
    const Tetrahedron x = mesh_.tet(t);
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = i + 1; j < 4; ++j)
        if (mesh_.remove_edge(x[i], x[j], FlipMesh::improve)) return true;
    for (std::size_t i = 0; i < 4; ++i)
      if (mesh_.remove_face(x[i], x[(i + 1) % 4], x[(i + 2) % 4], FlipMesh::improve)) return true;
    return false;
  }

  // Two flips: one that makes the ring of an edge of t smaller, so that the edge can be removed then.
  bool flip_twice(Index t) {
    const Tetrahedron x = mesh_.tet(t);
    const double q = mesh_.shape_of(x), floor = q + 1e-6 + 0.01 * std::abs(q);
    const auto gone = [&] { return !mesh_.alive(t) || mesh_.tet(t) != x; };
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = i + 1; j < 4; ++j) {
        const Index a = x[i], b = x[j];
        if (mesh_.is_protected(a, b)) continue;
        for (const Index r : mesh_.ring(a, b))
          for (const Edge& e : {Edge{a, r}, Edge{b, r}}) {
            if (!mesh_.remove_edge(e[0], e[1], floor)) continue;
            if (gone() || mesh_.remove_edge(a, b, floor)) return true;
            mesh_.undo();
          }
        for (const Index r : mesh_.ring(a, b)) {
          if (!mesh_.remove_face(a, b, r, floor)) continue;
          if (gone() || mesh_.remove_edge(a, b, floor)) return true;
          mesh_.undo();
        }
      }
    return false;
  }

  // A new node on an edge of t, moved to where it does most good.
  bool split(Index t) {
    const Tetrahedron x = mesh_.tet(t);
    const double q = mesh_.shape_of(x);
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = i + 1; j < 4; ++j) {
        Vec3 middle = Vec3::Zero();
        const std::vector<Index> ring = mesh_.ring(x[i], x[j]);
        for (const Index r : ring) middle += mesh_.node(r) / static_cast<double>(ring.size());
        const Index v = mesh_.split_edge(x[i], x[j], (mesh_.node(x[i]) + mesh_.node(x[j]) + 2 * middle) / 4);
        if (v < 0) continue;
        while (move(v)) {
        }
        if (worst_around(v) > q + 1e-3 + 0.1 * std::abs(q)) return true;
        mesh_.undo();
      }
    return false;
  }

  // Moves node v so that the worst tetrahedron about it gets better: towards the middle of its neighbours, up
  // the worst one's gradient, and along the axes, by shrinking steps.
  bool move(Index v) {
    if (v < first_free_ || mesh_.around(v).empty()) return false;
    const double before = worst_around(v);
    double best = before;
    Vec3& p = mesh_.nodes[static_cast<std::size_t>(v)];
    Vec3 middle = Vec3::Zero();
    for (const Index t : mesh_.around(v))
      for (const Index w : mesh_.tet(t)) middle += mesh_.node(w);
    middle = (middle / static_cast<double>(mesh_.around(v).size()) - p) / 3;  // each tetrahedron holds v once
    double step = 0;
    for (const Index t : mesh_.around(v))
      for (const Index w : mesh_.tet(t)) step = std::max(step, (mesh_.node(w) - p).norm());
    step *= 0.2;
    try_move(v, middle - p, best), try_move(v, (middle - p) / 2, best);
    for (int round = 0; round < 8; ++round) {
      bool better = try_move(v, step * gradient(v, 1e-4 * step), best);
      for (int axis = 0; axis < 3 && !better; ++axis)
        better = try_move(v, step * Vec3::Unit(axis), best) || try_move(v, -step * Vec3::Unit(axis), best);
      if (!better) step /= 2.5;
    }
    return best > before + 1e-6;
  }

 private:
  double worst_around(Index v) const {
    double worst = 2;
    for (const Index t : mesh_.around(v)) worst = std::min(worst, mesh_.shape_of(mesh_.tet(t)));
    return worst;
  }

  bool try_move(Index v, const Vec3& by, double& best) {
    Vec3& p = mesh_.nodes[static_cast<std::size_t>(v)];
    const Vec3 old = p;
    p += by;
    double worst = 2;
    for (const Index t : mesh_.around(v)) {
      worst = std::min(worst, mesh_.shape_of(mesh_.tet(t)));
      if (worst <= best) break;
    }
    if (worst > best) {
      best = worst;
      return true;
    }
    p = old;
    return false;
  }

  // Unit direction in which the worst tetrahedron about v gets better fastest.
  Vec3 gradient(Index v, double h) {
    const Tetrahedron* worst = nullptr;
    double least = 2;
    for (const Index t : mesh_.around(v)) {
      const double q = mesh_.shape_of(mesh_.tet(t));
      if (q < least) least = q, worst = &mesh_.tet(t);
    }
    Vec3& p = mesh_.nodes[static_cast<std::size_t>(v)];
    Vec3 g;
    for (int k = 0; k < 3; ++k) {
      const double old = p[k];
      p[k] = old + h;
      g[k] = mesh_.shape_of(*worst);
      p[k] = old - h;
      g[k] -= mesh_.shape_of(*worst);
      p[k] = old;
    }
    return g.norm() > 0 ? Vec3(g.normalized()) : Vec3(Vec3::Zero());
  }

  FlipMesh& mesh_;
  Index first_free_;
};

using Bad = std::pair<double, Index>;  // shape, tetrahedron

std::vector<Bad> worse_than(const FlipMesh& mesh, double goal) {
  std::vector<Bad> bad;
  for (std::size_t i = 0; i < mesh.tets().size(); ++i)
    if (const auto t = static_cast<Index>(i); mesh.alive(t))
      if (const double q = mesh.shape_of(mesh.tet(t)); q < goal) bad.push_back({q, t});
  std::sort(bad.begin(), bad.end());
  return bad;
}

}  // namespace

void improve(FlipMesh& mesh, Index first_free, double goal, const Progress& progress) {
  Improver improver(mesh, first_free);
  for (int round = 0; round < most_rounds; ++round) {
    const std::vector<Bad> bad = worse_than(mesh, goal);
    std::size_t better = 0;
    for (std::size_t i = 0; i < bad.size(); ++i) {
      if ((i & 63) == 0) progress.at(static_cast<double>(round) / most_rounds);
      const auto& [q, t] = bad[i];
      if (!mesh.alive(t) || mesh.shape_of(mesh.tet(t)) > q) continue;  // done on the way
      mesh.forget();
      if (improver.flip(t)) {
        ++better;
        continue;
      }
      const Tetrahedron x = mesh.tet(t);
      bool moved = false;
      for (const Index v : x) moved = improver.move(v) || moved;
      better += moved || (q < bad_shape && (improver.flip_twice(t) || (round > 1 && improver.split(t))));
    }
    if (better == 0 || (better * 200 <= bad.size() && round > 1 && bad.front().first > bad_shape / 10)) break;
  }
}

void flip_out(FlipMesh& mesh, double goal) {
  Improver improver(mesh, static_cast<Index>(mesh.nodes.size()));
  for (int round = 0; round < most_rounds; ++round) {
    std::size_t better = 0;
    for (const auto& [q, t] : worse_than(mesh, goal)) {
      mesh.forget();
      if (mesh.alive(t) && mesh.shape_of(mesh.tet(t)) <= q)
        better += improver.flip(t) || improver.flip_twice(t);
    }
    if (better == 0) break;
  }
}

}  // namespace palpate
