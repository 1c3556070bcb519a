// Lame's thick hollow sphere under inner pressure: Timoshenko, Goodier, Theory of Elasticity (1970), art.
// 142.
#pragma once

#include <algorithm>
#include <map>
#include <numbers>

#include "palpate/geometry/shapes.hpp"
#include "support/statics.hpp"
#include "support/traction.hpp"

namespace palpate::test {

struct HollowSphere {
  double inner = 0.02, outer = 0.04, pressure = 1000;  // m, m, Pa
  Material material{10e3, 0.3};

  double displacement(double r) const {  // radial, m
    const double a = inner * inner * inner, b = outer * outer * outer, nu = material.poisson;
    return pressure * a / (material.young * (b - a)) * ((1 - 2 * nu) * r + (1 + nu) * b / (2 * r * r));
  }
  double stress(double r) const {  // radial, Pa
    const double a = inner * inner * inner, b = outer * outer * outer;
    return pressure * a / (b - a) * (1 - b / (r * r * r));
  }
};

// The octant x, y, z >= 0: the three faces of a cube blown up to the sphere, cells x cells x layers blocks of
// six tetrahedra each. Kuhn's blocks have the same diagonals on opposite faces, so the three fit together.
inline TetMesh sphere_octant(const HollowSphere& sphere, int cells, int layers) {
  const TetMesh block = make_block({Vec3::Zero(), Vec3::Ones()}, {layers, cells, cells});
  TetMesh mesh;
  mesh.region_names = block.region_names;
  std::map<std::array<long, 3>, Index> known;
  for (Eigen::Index face = 0; face < 3; ++face) {
    std::vector<Index> number;
    for (const Vec3& p : block.nodes) {
      const auto even = [](double s) { return std::tan(0.25 * std::numbers::pi * s); };  // angles alike
      const Vec3 d = Vec3(1, even(p.y()), even(p.z())).normalized() *
                     (sphere.inner * std::pow(sphere.outer / sphere.inner, p.x()));
      Vec3 x;
      for (Eigen::Index a = 0; a < 3; ++a) x[(a + face) % 3] = d[a];
      const auto [at, is_new] =
          known.try_emplace({std::lround(1e9 * x.x()), std::lround(1e9 * x.y()), std::lround(1e9 * x.z())},
                            static_cast<Index>(mesh.nodes.size()));
      if (is_new) mesh.nodes.push_back(x);
      number.push_back(at->second);
    }
    for (Tetrahedron t : block.tets) {
      for (Index& v : t) v = number[static_cast<std::size_t>(v)];
      mesh.tets.push_back(t);
    }
  }
  mesh.regions.assign(mesh.tets.size(), 0);
  return mesh;
}

struct SphereErrors {
  std::size_t nodes = 0, surface = 0;
  double displacement = 0;  // radial at the mesh's nodes, largest difference / the value there
  double stress = 0;        // radial at the tetrahedra's centroids, L2, relative
};

inline SphereErrors sphere_errors(const HollowSphere& sphere, int order, int cells, int layers) {
  const TetMesh mesh = sphere_octant(sphere, cells, layers);
  const ElementNodes nodes = element_nodes(mesh, order);
  const double between = std::sqrt(sphere.inner * sphere.outer);
  const std::vector<Vec3> force =
      traction_forces(mesh, nodes, [&](const Vec3& x, const Vec3& normal) -> Vec3 {
        // Only the inner sphere's facets look at the centre; those in the planes of symmetry have x.n = 0.
        return x.norm() < between && normal.dot(x) < -0.5 * x.norm() ? Vec3(-sphere.pressure * normal)
                                                                     : Vec3(Vec3::Zero());
      });
  std::vector<bool> fixed;  // in each plane of symmetry, the component across it
  for (const Vec3& p : nodes.positions)
    for (Eigen::Index a = 0; a < 3; ++a) fixed.push_back(std::abs(p[a]) < 1e-9);
  Vector u = Vector::Zero(static_cast<Eigen::Index>(fixed.size()));
  solve_statics(assemble_stiffness(mesh, nodes, {sphere.material}), fixed, flat(force), u);

  SphereErrors errors{nodes.size(), boundary(mesh).nodes.size(), 0, 0};
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) {
    const double r = mesh.nodes[i].norm(),
                 radial = u.segment<3>(static_cast<Eigen::Index>(3 * i)).dot(mesh.nodes[i]) / r;
    errors.displacement = std::max(errors.displacement, std::abs(radial / sphere.displacement(r) - 1));
  }
  double difference = 0, all = 0;
  for (std::size_t e = 0; e < mesh.tets.size(); ++e) {
    Eigen::Matrix4d corners;
    for (int i = 0; i < 4; ++i)
      corners.col(i) << mesh.nodes[static_cast<std::size_t>(mesh.tets[e][static_cast<std::size_t>(i)])], 1;
    const Eigen::Matrix4d g = corners.inverse();  // rows: gradients of the barycentric coordinates
    Mat3 gradient = Mat3::Zero();
    const auto of = nodes.of(e);
    const auto at = [&](std::size_t i) -> Vec3 { return u.segment<3>(3 * of[i]); };
    // At the centroid the gradients of a quadratic tetrahedron's corners vanish: 4 l - 1 = 0.
    for (std::size_t i = 0; order == 1 && i < 4; ++i)
      gradient += at(i) * g.row(static_cast<Eigen::Index>(i)).head<3>();
    for (std::size_t i = 0; order == 2 && i < 6; ++i)
      gradient += at(4 + i) * (g.row(static_cast<Eigen::Index>(tet_edges[i][0])) +
                               g.row(static_cast<Eigen::Index>(tet_edges[i][1])))
                                  .head<3>();
    const Mat3 strain = 0.5 * (gradient + gradient.transpose());
    const Vec3 x = 0.25 * corners.rowwise().sum().head<3>();
    const Vec3 n = x.normalized();
    const double stress =
        sphere.material.lambda() * strain.trace() + 2 * sphere.material.mu() * n.dot(strain * n);
    const double volume = six_volume(mesh, mesh.tets[e]);
    difference += volume * std::pow(stress - sphere.stress(x.norm()), 2);
    all += volume * std::pow(sphere.stress(x.norm()), 2);
  }
  errors.stress = std::sqrt(difference / all);
  return errors;
}

}  // namespace palpate::test
