#include "palpate/elasticity/hats.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <numeric>
#include <random>

#include "palpate/geometry/shapes.hpp"
#include "support/meshes.hpp"

namespace palpate::test {
namespace {

struct Loaded {
  TetMesh mesh = jittered_block({4, 3, 3});
  Boundary outer = boundary(mesh);
  ElementNodes nodes = element_nodes(mesh, 2);
  std::vector<Index> all_free, every_hat;
  Loaded() : all_free(nodes.size()), every_hat(outer.nodes.size()) {
    // The surface, too, is to be nothing regular.
    for (Vec3& p : mesh.nodes)
      p += 0.004 * Vec3(std::sin(90 * p.y()), std::sin(90 * p.z()), std::sin(90 * p.x()));
    outer = boundary(mesh);
    nodes = element_nodes(mesh, 2);
    std::iota(all_free.begin(), all_free.end(), 0);
    std::iota(every_hat.begin(), every_hat.end(), 0);
  }
  Eigen::SparseMatrix<double> loads() const {
    return hat_loads(outer.surface, outer.nodes, nodes, all_free, every_hat);
  }
};

Vec3 linear(const Vec3& p) {
  return Vec3(0.3 * p.x() - p.y() + 0.1, p.z() + 2 * p.x(), p.y() - 0.4 * p.z() - 0.2);
}

TEST(Hats, ReadALinearFieldAtTheirCentroids) {
  const Loaded l;
  Eigen::VectorXd u(3 * static_cast<Eigen::Index>(l.nodes.size()));
  for (std::size_t i = 0; i < l.nodes.size(); ++i)
    u.segment<3>(3 * static_cast<Eigen::Index>(i)) = linear(l.nodes.positions[i]);
  const Eigen::VectorXd read = l.loads().transpose() * u;
  const std::vector<Vec3> centroids = hat_centroids(l.outer.surface);
  for (std::size_t i = 0; i < centroids.size(); ++i)
    EXPECT_LT((read.segment<3>(3 * static_cast<Eigen::Index>(i)) - linear(centroids[i])).norm(), 1e-14) << i;
}

// Its definition, integrated by brute force: the mean of position, weighted by the hat, over the surface.
TEST(Hats, CentroidsAreMeansOverTheHat) {
  const Loaded l;
  const std::vector<Vec3> centroids = hat_centroids(l.outer.surface);
  std::vector<Vec3> moment(centroids.size(), Vec3::Zero());
  std::vector<double> weight(centroids.size(), 0);
  constexpr int n = 60;
  for (const Triangle& t : l.outer.surface.triangles)
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n - i; ++j)
        for (const int upper : {0, 1}) {
          if (upper && i + j == n - 1) continue;
          const double third = upper ? 2.0 / 3 : 1.0 / 3;
          const std::array<double, 3> b{(i + third) / n, (j + third) / n, 1 - (i + j + 2 * third) / n};
          Vec3 x = Vec3::Zero();
          for (std::size_t k = 0; k < 3; ++k)
            x += b[k] * l.outer.surface.vertices[static_cast<std::size_t>(t[k])];
          for (std::size_t k = 0; k < 3; ++k) {
            const double w = b[k] * area_vector(l.outer.surface, t).norm();
            moment[static_cast<std::size_t>(t[k])] += w * x, weight[static_cast<std::size_t>(t[k])] += w;
          }
        }
  for (std::size_t i = 0; i < centroids.size(); ++i)
    EXPECT_LT((centroids[i] - moment[i] / weight[i]).norm(), 1e-6) << i;  // of 6 cm
}

TEST(Hats, AUnitForceIsOneNewtonAndOnlyPushes) {
  const Loaded l;
  const Eigen::SparseMatrix<double> loads = l.loads();
  for (Eigen::Index c = 0; c < loads.cols(); ++c) {
    Vec3 sum = Vec3::Zero();
    for (Eigen::SparseMatrix<double>::InnerIterator it(loads, c); it; ++it) {
      EXPECT_GT(it.value(), 0);
      sum[it.row() % 3] += it.value();
    }
    EXPECT_LT((sum - Vec3::Unit(c % 3)).norm(), 1e-14);
  }
}

TEST(Hats, WhatIsAnchoredTakesItsShareOfTheForce) {
  Loaded l;
  for (std::size_t i = 0; i < l.nodes.size(); ++i)
    if (l.nodes.positions[i].x() < 0.04) l.all_free[i] = -1;
  Index free = 0;
  for (Index& i : l.all_free)
    if (i >= 0) i = free++;
  const Eigen::SparseMatrix<double> loads = l.loads();
  EXPECT_EQ(loads.rows(), 3 * free);
  const Eigen::RowVectorXd sums = Eigen::RowVectorXd::Ones(loads.rows()) * loads;
  EXPECT_LT(sums.maxCoeff(), 1 + 1e-12);
  EXPECT_EQ(sums.minCoeff(), 0);
  EXPECT_TRUE(((sums.array() > 0.1) && (sums.array() < 0.9)).any());
}

TEST(Hats, ProjectionUndoesTheMean) {
  const Loaded l;
  for (const bool whole : {true, false}) {
    std::vector<Index> row_of(l.every_hat.size(), -1);
    std::vector<std::size_t> vertex;
    for (std::size_t i = 0; i < row_of.size(); ++i)
      if (whole || l.outer.surface.vertices[i].x() > 0.03)
        row_of[i] = static_cast<Index>(vertex.size()), vertex.push_back(i);
    const HatProjection projection(l.outer.surface, row_of);
    ASSERT_EQ(projection.rows(), vertex.size());
    // Any displacement of the vertices (those without a row stay), and its means by the exact mass matrix.
    std::mt19937 random(3);
    std::uniform_real_distribution<float> uniform(-1, 1);
    std::vector<Eigen::Vector4f> given, means(vertex.size(), Eigen::Vector4f::Zero()), found(vertex.size()),
        work(2 * vertex.size());
    for (std::size_t r = 0; r < vertex.size(); ++r)
      given.emplace_back(uniform(random), uniform(random), uniform(random), 0.0f);
    const std::vector<double> areas = vertex_areas(l.outer.surface);
    for (const Triangle& t : l.outer.surface.triangles)
      for (const Index i : t)
        for (const Index j : t) {
          const Index r = row_of[static_cast<std::size_t>(i)], c = row_of[static_cast<std::size_t>(j)];
          if (r < 0 || c < 0) continue;
          means[static_cast<std::size_t>(r)] +=
              static_cast<float>(area_vector(l.outer.surface, t).norm() / (i == j ? 6 : 12) /
                                 areas[static_cast<std::size_t>(i)]) *
              given[static_cast<std::size_t>(c)];
        }
    projection(means, found, work);
    for (std::size_t r = 0; r < vertex.size(); ++r) EXPECT_LT((found[r] - given[r]).norm(), 1e-3) << r;
  }
}

}  // namespace
}  // namespace palpate::test
