#include "palpate/elasticity/stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/base/parallel_for.hpp"
#include "palpate/elasticity/gradients.hpp"

namespace palpate {

namespace {

// Gradients of a tetrahedron's shape functions at its quadrature points, all of the same weight: of four
// nodes (linear) at one point, where they are constant, or of ten (quadratic) at four.
template <std::size_t Nodes>
struct Shape {
  static constexpr std::size_t points = Nodes == 4 ? 1 : 4;
  std::array<std::array<Vec3, points>, Nodes> g;  // 1/m

  explicit Shape(const std::array<Vec3, 4>& linear) {
    for (std::size_t q = 0; q < points; ++q) {
      if constexpr (Nodes == 4) {
        for (std::size_t i = 0; i < 4; ++i) g[i][q] = linear[i];
      } else {
        // Keast's rule of degree two: one barycentric coordinate is (5 + 3 sqrt 5) / 20, the others
        // (5 - sqrt 5) / 20.
        std::array<double, 4> l;
        l.fill(0.13819660112501052);
        l[q] = 0.58541019662496845;
        for (std::size_t i = 0; i < 4; ++i) g[i][q] = (4 * l[i] - 1) * linear[i];
        for (std::size_t e = 0; e < 6; ++e) {
          const auto [a, b] = tet_edges[e];
          g[4 + e][q] = 4 * (l[a] * linear[b] + l[b] * linear[a]);
        }
      }
    }
  }

  // Entry (a, b) of the 3x3 block between nodes i and j, with Lame's parameters times the points' weight.
  // Swapping (i, a) with (j, b) swaps factors only, never the order of sums: K(i, j) and K(j, i) are the same
  // bits.
  double entry(std::size_t i, std::size_t j, int a, int b, double lambda_w, double mu_w) const {
    double direct = 0, crossed = 0, trace = 0;
    for (std::size_t q = 0; q < points; ++q) {
      const Vec3 &x = g[i][q], &y = g[j][q];
      direct += x[a] * y[b], crossed += x[b] * y[a];
      if (a == b) trace += x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
    }
    return lambda_w * direct + mu_w * (crossed + trace);
  }
};

template <std::size_t Nodes>
Eigen::Matrix<double, 3 * Nodes, 3 * Nodes> element_stiffness(const std::array<Vec3, 4>& corners,
                                                              const Material& material) {
  const Gradients linear = gradients(corners);
  const Shape<Nodes> shape(linear.g);
  const double weight = linear.volume / static_cast<double>(shape.points);
  Eigen::Matrix<double, 3 * Nodes, 3 * Nodes> k;
  for (int i = 0; i < k.rows(); ++i)
    for (int j = 0; j < k.cols(); ++j)
      k(i, j) = shape.entry(static_cast<std::size_t>(i / 3), static_cast<std::size_t>(j / 3), i % 3, j % 3,
                            material.lambda() * weight, material.mu() * weight);
  return k;
}

struct Element {
  Gradients shape;
  double lambda_v, mu_v;  // Lame's parameters times the volume, J
};

// Lists in one array: those of i are items[start[i]] .. items[start[i + 1] - 1].
struct Lists {
  std::vector<std::size_t> start;
  std::vector<Index> items;
  std::span<const Index> operator[](std::size_t i) const {
    return {items.data() + start[i], start[i + 1] - start[i]};
  }
};

Lists tets_of_nodes(const ElementNodes& nodes) {
  Lists lists{std::vector<std::size_t>(nodes.size() + 1, 0), std::vector<Index>(nodes.of_tets.size())};
  for (const Index v : nodes.of_tets) ++lists.start[static_cast<std::size_t>(v) + 1];
  for (std::size_t i = 0; i < nodes.size(); ++i) lists.start[i + 1] += lists.start[i];
  std::vector<std::size_t> next(lists.start.begin(), lists.start.end() - 1);
  for (std::size_t i = 0; i < nodes.of_tets.size(); ++i)
    lists.items[next[static_cast<std::size_t>(nodes.of_tets[i])]++] = static_cast<Index>(i / nodes.per_tet());
  return lists;
}

// Nodes that share a tetrahedron with each node, itself included, ascending.
Lists neighbours_of_nodes(const ElementNodes& nodes, const Lists& tets_of) {
  Lists lists;
  lists.start.reserve(nodes.size() + 1);
  lists.start.push_back(0);
  lists.items.reserve((nodes.order == 1 ? 16 : 30) * nodes.size());
  std::vector<Index> seen_by(nodes.size(), -1);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (const Index e : tets_of[i])
      for (const Index v : nodes.of(static_cast<std::size_t>(e)))
        if (seen_by[static_cast<std::size_t>(v)] != static_cast<Index>(i)) {
          seen_by[static_cast<std::size_t>(v)] = static_cast<Index>(i);
          lists.items.push_back(v);
        }
    std::sort(lists.items.begin() + static_cast<std::ptrdiff_t>(lists.start.back()), lists.items.end());
    lists.start.push_back(lists.items.size());
  }
  return lists;
}

std::vector<Element> elements_of(const TetMesh& mesh, const std::vector<Material>& materials, int threads) {
  require_valid(mesh, materials);
  std::vector<Element> elements(mesh.tets.size());
  parallel_for(mesh.tets.size(), 4096, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      const Material& m = material_of(mesh, materials, e);
      const Gradients shape = gradients(corners_of(mesh, mesh.tets[e]));
      elements[e] = {shape, m.lambda() * shape.volume, m.mu() * shape.volume};
    }
  });
  return elements;
}

// Column by column: each thread writes its own nodes' columns, each sum runs over tetrahedra ascending.
template <std::size_t Nodes>
void fill_columns(const ElementNodes& nodes, const std::vector<Element>& elements, const Lists& tets_of,
                  const Lists& neighbours, int threads, Eigen::SparseMatrix<double>& k) {
  int* outer = k.outerIndexPtr();
  parallel_for(nodes.size(), 256, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) {
      const std::span<const Index> rows = neighbours[j];
      const std::size_t first = 9 * neighbours.start[j], height = 3 * rows.size();
      double* values = k.valuePtr() + first;
      std::fill_n(values, 3 * height, 0.0);
      for (std::size_t b = 0; b < 3; ++b) {
        outer[3 * j + b] = static_cast<int>(first + b * height);
        int* inner = k.innerIndexPtr() + first + b * height;
        for (const Index v : rows)
          for (int a = 0; a < 3; ++a) *inner++ = 3 * v + a;
      }
      for (const Index e : tets_of[j]) {
        const std::span<const Index> t = nodes.of(static_cast<std::size_t>(e));
        const auto& [linear, lambda_v, mu_v] = elements[static_cast<std::size_t>(e)];
        const Shape<Nodes> shape(linear.g);
        const double weight = 1.0 / static_cast<double>(shape.points);
        const auto own =
            static_cast<std::size_t>(std::find(t.begin(), t.end(), static_cast<Index>(j)) - t.begin());
        for (std::size_t i = 0; i < Nodes; ++i) {
          const auto row =
              static_cast<std::size_t>(std::lower_bound(rows.begin(), rows.end(), t[i]) - rows.begin());
          for (std::size_t b = 0; b < 3; ++b)
            for (std::size_t a = 0; a < 3; ++a)
              values[b * height + 3 * row + a] += shape.entry(
                  i, own, static_cast<int>(a), static_cast<int>(b), lambda_v * weight, mu_v * weight);
        }
      }
    }
  });
}

}  // namespace

void require_valid(const TetMesh& mesh, const std::vector<Material>& materials) {
  const bool of_regions = materials.size() == mesh.region_names.size();
  if (!of_regions && materials.size() != mesh.tets.size())
    throw Error(ErrorKind::physics, "{} materials for {} regions and {} tetrahedra; give each region one",
                materials.size(), mesh.region_names.size(), mesh.tets.size());
  for (std::size_t i = 0; i < materials.size(); ++i)
    require_valid(materials[i],
                  of_regions ? "region '" + mesh.region_names[i] + "'" : "tetrahedron " + std::to_string(i));
}

Eigen::Matrix<double, 12, 12> element_stiffness_p1(const std::array<Vec3, 4>& corners,
                                                   const Material& material) {
  return element_stiffness<4>(corners, material);
}

Eigen::Matrix<double, 30, 30> element_stiffness_p2(const std::array<Vec3, 4>& corners,
                                                   const Material& material) {
  return element_stiffness<10>(corners, material);
}

Eigen::SparseMatrix<double> assemble_stiffness(const TetMesh& mesh, const std::vector<Material>& materials,
                                               int threads) {
  return assemble_stiffness(mesh, element_nodes(mesh, 1), materials, threads);
}

Eigen::SparseMatrix<double> assemble_stiffness(const TetMesh& mesh, const ElementNodes& nodes,
                                               const std::vector<Material>& materials, int threads) {
  require_valid(mesh, "stiffness");
  const std::vector<Element> elements = elements_of(mesh, materials, threads);
  const Lists tets_of = tets_of_nodes(nodes), neighbours = neighbours_of_nodes(nodes, tets_of);
  if (9 * neighbours.items.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw Error(ErrorKind::resource, "stiffness of {} nodes has more than 2^31 entries; use a coarser mesh",
                nodes.size());
  const auto n = static_cast<Eigen::Index>(3 * nodes.size());
  Eigen::SparseMatrix<double> k(n, n);
  k.resizeNonZeros(static_cast<Eigen::Index>(9 * neighbours.items.size()));
  k.outerIndexPtr()[n] = static_cast<int>(9 * neighbours.items.size());
  const auto fill = nodes.order == 1 ? fill_columns<4> : fill_columns<10>;
  fill(nodes, elements, tets_of, neighbours, threads, k);
  return k;
}

FreeStiffness remove_anchored(const Eigen::SparseMatrix<double>& stiffness,
                              const std::vector<std::uint8_t>& anchored) {
  if (stiffness.rows() != stiffness.cols() ||
      stiffness.rows() != static_cast<Eigen::Index>(3 * anchored.size()))
    throw Error(ErrorKind::internal, "remove_anchored: stiffness of {} rows, flags for {} nodes",
                stiffness.rows(), anchored.size());
  FreeStiffness free;
  free.free_of.assign(anchored.size(), -1);
  for (std::size_t i = 0; i < anchored.size(); ++i)
    if (!anchored[i]) {
      free.free_of[i] = static_cast<Index>(free.node_of.size());
      free.node_of.push_back(static_cast<Index>(i));
    }
  const int* outer = stiffness.outerIndexPtr();
  const auto free_row = [&](int entry) -> int {
    const int row = stiffness.innerIndexPtr()[entry];
    const Index node = free.free_of[static_cast<std::size_t>(row / 3)];
    return node < 0 ? -1 : 3 * node + row % 3;
  };
  const auto n = static_cast<Eigen::Index>(3 * free.node_of.size());
  std::vector<int> start(static_cast<std::size_t>(n) + 1, 0);
  std::size_t column = 0;
  for (const Index node : free.node_of)
    for (int b = 0; b < 3; ++b, ++column) {
      start[column + 1] = start[column];
      for (int e = outer[3 * node + b]; e < outer[3 * node + b + 1]; ++e)
        start[column + 1] += free_row(e) >= 0;
    }
  free.matrix.resize(n, n);
  free.matrix.resizeNonZeros(start.back());
  std::copy(start.begin(), start.end(), free.matrix.outerIndexPtr());
  int next = 0;
  for (const Index node : free.node_of)
    for (int e = outer[3 * node]; e < outer[3 * node + 3]; ++e)
      if (const int row = free_row(e); row >= 0) {
        free.matrix.innerIndexPtr()[next] = row;
        free.matrix.valuePtr()[next++] = stiffness.valuePtr()[e];
      }
  return free;
}

std::vector<Mat3> strains(const TetMesh& mesh, const std::vector<Vec3>& displacement) {
  if (displacement.size() != mesh.nodes.size())
    throw Error(ErrorKind::internal, "strains: {} displacements for {} nodes", displacement.size(),
                mesh.nodes.size());
  std::vector<Mat3> result;
  result.reserve(mesh.tets.size());
  for (const Tetrahedron& t : mesh.tets) {
    const Gradients shape = gradients(corners_of(mesh, t));
    Mat3 gradient = Mat3::Zero();
    for (std::size_t i = 0; i < 4; ++i)
      gradient += displacement[static_cast<std::size_t>(t[i])] * shape.g[i].transpose();
    result.push_back(0.5 * (gradient + gradient.transpose()));
  }
  return result;
}

}  // namespace palpate
