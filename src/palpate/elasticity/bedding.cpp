#include "palpate/elasticity/bedding.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// The boundary's triangles that a bedding takes, by nodes of the mesh.
std::vector<Triangle> triangles_of(const TetMesh& mesh, const Boundary& outer, const Bedding& bedding) {
  if (!(bedding.modulus > 0) || !std::isfinite(bedding.modulus))
    throw Error(ErrorKind::physics, "bedding '{}': its modulus must be positive, N/m3", to_string(bedding));
  const std::vector<std::uint8_t> taken = nodes_taken(mesh, {bedding.where});
  std::vector<Triangle> out;
  for (Triangle t : outer.surface.triangles) {
    bool all = true;
    for (Index& v : t) v = outer.nodes[at(v)], all = all && taken[at(v)];
    if (all) out.push_back(t);
  }
  if (out.empty())
    throw Error(ErrorKind::physics,
                "bedding '{}': no triangle of the surface has all three corners there; choose it larger",
                to_string(bedding));
  return out;
}

// Integrals of products of a triangle's shape functions over its area: corners, then the middles of sides
// 01, 12, 20 of the quadratic one.
Eigen::Matrix<double, 6, 6> products(int order) {
  Eigen::Matrix<double, 6, 6> m = Eigen::Matrix<double, 6, 6>::Zero();
  if (order == 1) {
    m.topLeftCorner<3, 3>().setConstant(1.0 / 12);
    m.diagonal().head<3>().setConstant(1.0 / 6);
    return m;
  }
  m.topLeftCorner<3, 3>().setConstant(-1);
  m.bottomRightCorner<3, 3>().setConstant(16);
  m.diagonal() << 6, 6, 6, 32, 32, 32;
  for (int middle = 0; middle < 3; ++middle) {
    const int opposite = (middle + 2) % 3;
    m(3 + middle, opposite) = m(opposite, 3 + middle) = -4;
  }
  return m / 180;
}

}  // namespace

Bedding parse_bedding(const std::string& text, double unit) {
  const std::size_t begin = std::min(text.find_first_not_of(" \t"), text.size());
  const std::size_t end = std::min(text.find_first_of(" \t", begin), text.size());
  Bedding bedding;
  const auto [stop, error] = std::from_chars(text.data() + begin, text.data() + end, bedding.modulus);
  if (error != std::errc() || stop != text.data() + end || !(bedding.modulus > 0) ||
      !std::isfinite(bedding.modulus))
    throw Error(ErrorKind::usage,
                "bedding '{}': say its modulus in N/m3 (Pa/m), above zero, and where it is, as in "
                "\"2e5 half-space 0 0 -0.016 0 0 1\"",
                text.size() > 80 ? text.substr(0, 77) + "..." : text);
  bedding.where = parse_anchor(text.substr(end), unit);
  return bedding;
}

std::string to_string(const Bedding& bedding) {
  return fmt::format("{} {}", bedding.modulus, to_string(bedding.where));
}

void add_bedding(const TetMesh& mesh, const ElementNodes& nodes, const std::vector<Bedding>& beddings,
                 Eigen::SparseMatrix<double>& stiffness) {
  if (beddings.empty()) return;
  const Boundary outer = boundary(mesh);
  const Eigen::Matrix<double, 6, 6> shape = products(nodes.order);
  for (const Bedding& bedding : beddings)
    for (const Triangle& t : triangles_of(mesh, outer, bedding)) {
      const Vec3 &a = mesh.nodes[at(t[0])], &b = mesh.nodes[at(t[1])], &c = mesh.nodes[at(t[2])];
      const double scale = bedding.modulus * 0.5 * (b - a).cross(c - a).norm();
      std::array<Index, 6> of{t[0], t[1], t[2], -1, -1, -1};
      const int count = nodes.order == 1 ? 3 : 6;
      for (std::size_t i = 0; i < 3 && count == 6; ++i) of[3 + i] = nodes.middle(t[i], t[(i + 1) % 3]);
      for (int i = 0; i < count; ++i)
        for (int j = 0; j < count; ++j)
          for (int axis = 0; axis < 3 && shape(i, j) != 0; ++axis)
            stiffness.coeffRef(3 * of[static_cast<std::size_t>(i)] + axis,
                               3 * of[static_cast<std::size_t>(j)] + axis) += scale * shape(i, j);
    }
}

std::vector<std::uint8_t> bedded_nodes(const TetMesh& mesh, const std::vector<Bedding>& beddings) {
  std::vector<std::uint8_t> flags(mesh.nodes.size(), 0);
  if (beddings.empty()) return flags;
  const Boundary outer = boundary(mesh);
  for (const Bedding& bedding : beddings)
    for (const Triangle& t : triangles_of(mesh, outer, bedding))
      for (const Index v : t) flags[at(v)] = 1;
  return flags;
}

}  // namespace palpate
