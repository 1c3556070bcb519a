#include "palpate/pad/stencils.hpp"

#include <algorithm>

namespace palpate {

namespace {

class Stencil {
 public:
  Stencil(const Cutter& cutter, std::vector<Tetrahedron>& out) : cutter_(cutter), out_(out) {}

  void add(Tetrahedron t) {
    const Vec3 a = cutter_.position(t[0]);
    if ((cutter_.position(t[1]) - a).cross(cutter_.position(t[2]) - a).dot(cutter_.position(t[3]) - a) < 0)
      std::swap(t[2], t[3]);
    out_.push_back(t);
  }

  // A triangular prism, edges a_i b_i. from[i]: of the quadrilateral opposite to edge i, with the edges j and
  // k after it in turn, whether it is divided from a_j instead of from a_k. Not all three alike.
  void prism(const std::array<Index, 3>& a, const std::array<Index, 3>& b, const std::array<bool, 3>& from) {
    // Diagonals that end in a_i: of its quadrilaterals with i + 1 and with i + 2.
    const auto count = [&](std::size_t i) { return int(from[(i + 2) % 3]) + int(!from[(i + 1) % 3]); };
    std::size_t i = 0, j = 0, k = 0;
    for (std::size_t n = 0; n < 3; ++n) (count(n) == 2 ? i : count(n) == 1 ? j : k) = n;
    add({a[i], a[j], a[k], b[k]});
    add({a[i], a[j], b[j], b[k]});
    add({a[i], b[i], b[j], b[k]});
  }

 private:
  const Cutter& cutter_;
  std::vector<Tetrahedron>& out_;
};

// sin of the smallest dihedral angle, roughly: six volumes over the product of the two largest faces' areas.
double worst_shape(const Cutter& cutter, const std::vector<Tetrahedron>& tets) {
  double worst = 1;
  for (const Tetrahedron& t : tets) {
    std::array<Vec3, 4> p;
    for (std::size_t i = 0; i < 4; ++i) p[i] = cutter.position(t[i]);
    std::array<Vec3, 4> normal;
    for (std::size_t i = 0; i < 4; ++i) {
      const Vec3 &x = p[(i + 1) % 4], &y = p[(i + 2) % 4], &z = p[(i + 3) % 4];
      normal[i] = (y - x).cross(z - x).normalized();
      if (normal[i].dot(p[i] - x) > 0) normal[i] = -normal[i];
    }
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < i; ++j) worst = std::min(worst, normal[i].cross(normal[j]).norm());
  }
  return worst;
}

}  // namespace

void fill(const Tetrahedron& t, const Cutter& cutter, std::vector<Tetrahedron>& out) {
  std::array<Index, 4> in, on, off;
  std::size_t plus = 0, zero = 0, minus = 0;
  for (const Index v : t) {
    const int s = cutter.sign(v);
    (s > 0 ? in[plus++] : s < 0 ? off[minus++] : on[zero++]) = v;
  }
  if (plus == 0) return;
  Stencil stencil(cutter, out);
  if (minus == 0) return stencil.add(t);
  const auto cut = [&](Index a, Index b) { return cutter.cut(a, b); };
  if (plus == 1) {
    Tetrahedron small{in[0]};
    for (std::size_t i = 0; i < zero; ++i) small[1 + i] = on[i];
    for (std::size_t i = 0; i < minus; ++i) small[1 + zero + i] = cut(in[0], off[i]);
    return stencil.add(small);
  }
  if (plus == 3) {
    const Index c = off[0];
    return stencil.prism({in[0], in[1], in[2]}, {cut(in[0], c), cut(in[1], c), cut(in[2], c)},
                         {cutter.from_first(in[1], in[2], c), cutter.from_first(in[2], in[0], c),
                          cutter.from_first(in[0], in[1], c)});
  }
  const Index a = in[0], b = in[1];
  if (zero == 1) {
    const Index ca = cut(a, off[0]), cb = cut(b, off[0]);
    const bool from_a = cutter.from_first(a, b, off[0]);
    stencil.add({on[0], a, b, from_a ? cb : ca});
    return stencil.add({on[0], from_a ? a : b, ca, cb});
  }
  // Two in, two out: the prism from a to b, its third quadrilateral on the surface and free.
  const std::array<Index, 3> from{a, cut(a, off[0]), cut(a, off[1])}, to{b, cut(b, off[0]), cut(b, off[1])};
  const bool first = cutter.from_first(a, b, off[0]), second = cutter.from_first(a, b, off[1]);
  std::vector<Tetrahedron> best;
  double best_shape = -1;
  for (const bool free : {false, true}) {
    const std::array<bool, 3> divided{free, !second, first};
    if (divided[0] == divided[1] && divided[1] == divided[2]) continue;
    std::vector<Tetrahedron> trial;
    Stencil(cutter, trial).prism(from, to, divided);
    const double shape = worst_shape(cutter, trial);
    if (shape > best_shape) best_shape = shape, best = trial;
  }
  out.insert(out.end(), best.begin(), best.end());
}

}  // namespace palpate
