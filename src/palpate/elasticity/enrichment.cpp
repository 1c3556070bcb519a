#include "palpate/elasticity/enrichment.hpp"

#include <algorithm>

#include "palpate/elasticity/gradients.hpp"
#include "palpate/elasticity/stiffness.hpp"

namespace palpate {

namespace {

constexpr std::array<std::array<std::size_t, 3>, 4> tet_faces{{{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}}};
using Barycentric = Eigen::Vector4d;

struct Point {
  Barycentric l;
  double weight;
};

// Degree two (Keast 1986) for products of linear slopes; degree five (Walkington 2000) for those of quadratic
// ones.
std::vector<Point> tet_rule(int order) {
  std::vector<Point> points;
  const auto corners = [&](double a, double weight) {
    for (int i = 0; i < 4; ++i) {
      points.push_back({Barycentric::Constant(a), weight});
      points.back().l[i] = 1 - 3 * a;
    }
  };
  if (order == 1) {
    corners(0.13819660112501052, 0.25);
    return points;
  }
  corners(0.0927352503108912, 0.07349304311636196);
  corners(0.3108859192633006, 0.1126879257180158);
  constexpr double b = 0.4544962958743506;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < i; ++j) {
      points.push_back({Barycentric::Constant(b), 0.04254602077708147});
      points.back().l[i] = points.back().l[j] = 0.5 - b;
    }
  return points;
}

// Slopes along the barycentric coordinates of the nodes' functions.
Eigen::Matrix<double, 4, Eigen::Dynamic> own_slopes(int order, const Barycentric& l) {
  Eigen::Matrix<double, 4, Eigen::Dynamic> d = Eigen::MatrixXd::Zero(4, order == 1 ? 4 : 10);
  for (int i = 0; i < 4; ++i) d(i, i) = order == 1 ? 1 : 4 * l[i] - 1;
  for (std::size_t e = 0; order == 2 && e < 6; ++e) {
    const auto a = static_cast<int>(tet_edges[e][0]), b = static_cast<int>(tet_edges[e][1]);
    d(a, 4 + static_cast<int>(e)) = 4 * l[b], d(b, 4 + static_cast<int>(e)) = 4 * l[a];
  }
  return d;
}

// Of the added ones: 4 la lb; or la lb (la - lb) and la lb lc.
Eigen::Matrix<double, 4, Eigen::Dynamic> more_slopes(int order, const Barycentric& l) {
  Eigen::Matrix<double, 4, Eigen::Dynamic> d = Eigen::MatrixXd::Zero(4, order == 1 ? 6 : 10);
  for (std::size_t e = 0; e < 6; ++e) {
    const auto a = static_cast<int>(tet_edges[e][0]), b = static_cast<int>(tet_edges[e][1]);
    d(a, static_cast<int>(e)) = order == 1 ? 4 * l[b] : l[b] * (2 * l[a] - l[b]);
    d(b, static_cast<int>(e)) = order == 1 ? 4 * l[a] : l[a] * (l[a] - 2 * l[b]);
  }
  for (std::size_t f = 0; order == 2 && f < 4; ++f)
    for (std::size_t i = 0; i < 3; ++i)
      d(static_cast<int>(tet_faces[f][i]), 6 + static_cast<int>(f)) =
          l[static_cast<int>(tet_faces[f][(i + 1) % 3])] * l[static_cast<int>(tet_faces[f][(i + 2) % 3])];
  return d;
}

std::array<Index, 3> edge(Index a, Index b) { return {std::min(a, b), std::max(a, b), -1}; }
std::array<Index, 3> face(Index a, Index b, Index c) {
  std::array<Index, 3> f{a, b, c};
  std::sort(f.begin(), f.end());
  return f;
}

template <class Visit>
void each_function(const Tetrahedron& t, int order, Visit&& visit) {
  std::size_t i = 0;
  for (const auto& [a, b] : tet_edges) visit(i++, edge(t[a], t[b]));
  if (order == 2)
    for (const auto& f : tet_faces) visit(i++, face(t[f[0]], t[f[1]], t[f[2]]));
}

Vec3 three(const Eigen::VectorXd& v, Index i) { return v.segment<3>(3 * static_cast<Eigen::Index>(i)); }

}  // namespace

Index Enrichment::find(const Function& f) const {
  const auto at = std::lower_bound(functions_.begin(), functions_.end(), f);
  return at == functions_.end() || *at != f ? -1 : static_cast<Index>(at - functions_.begin());
}

Enrichment::Enrichment(const TetMesh& mesh, const ElementNodes& nodes, const std::vector<Material>& materials,
                       std::span<const Index> free_of, const std::vector<Index>& tets)
    : order_(nodes.order) {
  for (const Point& p : tet_rule(order_)) {
    weight_.push_back(p.weight);
    own_.push_back(own_slopes(order_, p.l));
    more_.push_back(more_slopes(order_, p.l));
  }
  std::vector<std::uint8_t> inside(mesh.tets.size(), 0);
  for (const Index t : tets) {
    inside[static_cast<std::size_t>(t)] = 1;
    each_function(mesh.tets[static_cast<std::size_t>(t)], order_,
                  [&](std::size_t, const Function& f) { functions_.push_back(f); });
  }
  std::sort(functions_.begin(), functions_.end());
  functions_.erase(std::unique(functions_.begin(), functions_.end()), functions_.end());
  std::vector<std::uint8_t> dropped(functions_.size(), 0);
  const auto anchored = [&](Index n) { return n < 0 || free_of[static_cast<std::size_t>(n)] < 0; };
  for (std::size_t i = 0; i < functions_.size(); ++i)
    dropped[i] = std::all_of(functions_[i].begin(), functions_[i].end(), anchored);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    if (!inside[t])
      each_function(mesh.tets[t], order_, [&](std::size_t, const Function& f) {
        if (const Index i = find(f); i >= 0) dropped[static_cast<std::size_t>(i)] = 1;
      });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < functions_.size(); ++i)
    if (!dropped[i]) functions_[kept++] = functions_[i];
  functions_.resize(kept);

  for (const Index t : tets) {
    const auto tet = static_cast<std::size_t>(t);
    const Gradients linear = gradients(corners_of(mesh, mesh.tets[tet]));
    const Material& m = material_of(mesh, materials, tet);
    Element e{};
    for (int i = 0; i < 4; ++i) e.g.row(i) = linear.g[static_cast<std::size_t>(i)];
    e.lambda_v = m.lambda() * linear.volume, e.mu_v = m.mu() * linear.volume;
    e.node.fill(-1), e.added.fill(-1), e.sign.fill(1);
    const std::span<const Index> of = nodes.of(tet);
    for (std::size_t i = 0; i < of.size(); ++i) e.node[i] = free_of[static_cast<std::size_t>(of[i])];
    each_function(mesh.tets[tet], order_, [&](std::size_t i, const Function& f) {
      e.added[i] = find(f);
      // Cubic functions of an edge change sign with its direction.
      if (order_ == 2 && i < 6 && mesh.tets[tet][tet_edges[i][0]] != f[0]) e.sign[i] = -1;
    });
    elements_.push_back(e);
  }

  std::vector<Mat3> diagonal(kept, Mat3::Zero());
  for (const Element& e : elements_)
    for (std::size_t i = 0; i < e.added.size(); ++i) {
      if (e.added[i] < 0) continue;
      Mat3& block = diagonal[static_cast<std::size_t>(e.added[i])];
      for (std::size_t q = 0; q < weight_.size(); ++q) {
        const Vec3 d = e.g.transpose() * more_[q].col(static_cast<Eigen::Index>(i));
        block += weight_[q] *
                 ((e.lambda_v + e.mu_v) * d * d.transpose() + e.mu_v * d.squaredNorm() * Mat3::Identity());
      }
    }
  for (const Mat3& block : diagonal) inverse_.push_back(block.inverse());
}

void Enrichment::multiply(const Eigen::VectorXd& u, const Eigen::VectorXd& w, Eigen::VectorXd& force,
                          Eigen::VectorXd& added) const {
  using Columns = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 10>;
  const Eigen::Index own = own_[0].cols(), more = more_[0].cols();
  added = Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(size()));
  Columns x(3, own), y(3, more), fx(3, own), fy(3, more);
  for (const Element& e : elements_) {
    for (Eigen::Index i = 0; i < own; ++i) {
      const Index n = e.node[static_cast<std::size_t>(i)];
      x.col(i) = n < 0 ? Vec3::Zero() : three(u, n);
    }
    for (Eigen::Index i = 0; i < more; ++i) {
      const Index f = e.added[static_cast<std::size_t>(i)];
      y.col(i) = f < 0 ? Vec3::Zero() : Vec3(e.sign[static_cast<std::size_t>(i)] * three(w, f));
    }
    fx.setZero(), fy.setZero();
    // Stress times gradients, along the barycentric coordinates.
    const auto flow = [&](const Eigen::Matrix<double, 3, 4>& slopes, double weight) {
      const Mat3 h = slopes * e.g;
      const Mat3 stress = weight * (e.mu_v * (h + h.transpose()) + e.lambda_v * h.trace() * Mat3::Identity());
      return Eigen::Matrix<double, 3, 4>(stress * e.g.transpose());
    };
    for (std::size_t q = 0; q < weight_.size(); ++q) {
      Eigen::Matrix<double, 3, 4> of_u = Eigen::Matrix<double, 3, 4>::Zero(), of_w = of_u;
      for (Eigen::Index i = 0; i < own; ++i) of_u += x.col(i) * own_[q].col(i).transpose();
      for (Eigen::Index i = 0; i < more; ++i) of_w += y.col(i) * more_[q].col(i).transpose();
      const Eigen::Matrix<double, 3, 4> from_w = flow(of_w, weight_[q]),
                                        from_both = from_w + flow(of_u, weight_[q]);
      for (Eigen::Index i = 0; i < own; ++i) fx.col(i) += from_w * own_[q].col(i);
      for (Eigen::Index i = 0; i < more; ++i) fy.col(i) += from_both * more_[q].col(i);
    }
    for (Eigen::Index i = 0; i < own; ++i)
      if (const Index n = e.node[static_cast<std::size_t>(i)]; n >= 0)
        force.segment<3>(3 * static_cast<Eigen::Index>(n)) += fx.col(i);
    for (Eigen::Index i = 0; i < more; ++i)
      if (const Index f = e.added[static_cast<std::size_t>(i)]; f >= 0)
        added.segment<3>(3 * static_cast<Eigen::Index>(f)) += e.sign[static_cast<std::size_t>(i)] * fy.col(i);
  }
}

Eigen::VectorXd Enrichment::precondition(const Eigen::VectorXd& added) const {
  Eigen::VectorXd out(added.size());
  for (std::size_t i = 0; i < size(); ++i)
    out.segment<3>(3 * static_cast<Eigen::Index>(i)) = inverse_[i] * three(added, static_cast<Index>(i));
  return out;
}

void Enrichment::add_traction(const ElementNodes& nodes, std::span<const Index> free_of, const Triangle& t,
                              double area, const std::array<Vec3, 3>& traction, Eigen::VectorXd& force,
                              Eigen::VectorXd& added) const {
  const auto on_node = [&](Index n, const Vec3& f) {
    if (const Index free = free_of[static_cast<std::size_t>(n)]; free >= 0)
      force.segment<3>(3 * static_cast<Eigen::Index>(free)) += f;
  };
  const auto on_function = [&](const Function& function, const Vec3& f) {
    if (const Index i = find(function); i >= 0) added.segment<3>(3 * static_cast<Eigen::Index>(i)) += f;
  };
  // Degree four: Dunavant 1985.
  for (const auto& [a, weight] :
       {std::pair{0.445948490915965, 0.223381589678011}, {0.091576213509771, 0.109951743655322}})
    for (std::size_t corner = 0; corner < 3; ++corner) {
      std::array<double, 3> l{a, a, a};
      l[corner] = 1 - 2 * a;
      Vec3 f = Vec3::Zero();
      for (std::size_t i = 0; i < 3; ++i) f += area * weight * l[i] * traction[i];
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t j = (i + 1) % 3;
        const Function e = edge(t[i], t[j]);
        if (order_ == 1) {
          on_node(t[i], l[i] * f);
          on_function(e, 4 * l[i] * l[j] * f);
        } else {
          on_node(t[i], l[i] * (2 * l[i] - 1) * f);
          on_node(nodes.middle(t[i], t[j]), 4 * l[i] * l[j] * f);
          on_function(e, (e[0] == t[i] ? 1 : -1) * l[i] * l[j] * (l[i] - l[j]) * f);
        }
      }
      if (order_ == 2) on_function(face(t[0], t[1], t[2]), l[0] * l[1] * l[2] * f);
    }
}

}  // namespace palpate
