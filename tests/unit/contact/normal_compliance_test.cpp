#include "palpate/contact/normal_compliance.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <random>

#include "palpate/contact/projected_gradients.hpp"
#include "palpate/contact/solver.hpp"

namespace palpate {
namespace {

constexpr std::size_t rows = 60;

// Symmetric positive definite, like a compliance between points on a line.
Compliance some_compliance(std::mt19937& random, std::size_t n = rows) {
  HugeArray<float> matrix(9 * n * n);
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd a =
      Eigen::MatrixXd::NullaryExpr(3 * n, 3 * n, [&](Eigen::Index, Eigen::Index) { return normal(random); });
  const Eigen::MatrixXd c = a * a.transpose() + 20 * Eigen::MatrixXd::Identity(3 * n, 3 * n);
  for (std::size_t i = 0; i < 3 * n; ++i)
    for (std::size_t j = 0; j < 3 * n; ++j)
      matrix[i * 3 * n + j] =
          static_cast<float>(c(static_cast<int>(std::max(i, j)), static_cast<int>(std::min(i, j))));
  return Compliance::dense(std::move(matrix), n);
}

// Points come and go, turn, touch a node twice, or are held in a grip; what is kept must be what it would be
// made anew.
TEST(NormalCompliance, IsKeptRightWhateverCameBefore) {
  std::mt19937 random(5);
  const Compliance c = some_compliance(random);
  ContactBlock block(rows, 0, rows, 3);
  NormalCompliance kept(block.plane(), 2 * rows);
  std::vector<Vec3> normal(rows);
  for (Vec3& n : normal) n = Vec3::Random().normalized();
  std::size_t changed = 0;
  for (int tick = 0; tick < 200; ++tick) {
    std::vector<ContactPoint> points;
    std::vector<Index> wanted;
    for (std::size_t k = 0; k < rows; ++k) {
      if ((k + static_cast<std::size_t>(tick / 10)) % 7 == 0) continue;
      if (random() % 20 == 0) normal[k] = Vec3::Random().normalized(), ++changed;
      wanted.push_back(static_cast<Index>(k));
      ContactPoint p;
      p.row = static_cast<Index>(k), p.normal = normal[k];
      points.push_back(p);
      if (k % 11 == 0) p.normal = -normal[(k + 1) % rows], points.push_back(p);  // a second instrument
      if (k == 20 && tick % 3 == 0) {
        points.pop_back();
        for (int a = 0; a < 3; ++a) p.normal = Vec3::Unit(a), p.grasped = true, points.push_back(p);
      }
    }
    block.require(c, wanted);
    for (ContactPoint& p : points) p.slot = block.slot_of(p.row);
    if (tick % 4 == 0) {  // a place on three nodes
      ContactPoint p;
      p.slot = block.combine({points[0].slot, points[5].slot, -1}, Vec3(0.5, 0.3, 0.2));
      p.normal = Vec3(0, 0.6, 0.8);
      points.push_back(p);
    }
    kept.update(block, points, 0);
    Eigen::MatrixXd whole =
        Eigen::MatrixXd::Identity(static_cast<int>(kept.size()), static_cast<int>(kept.size()));
    for (std::size_t i = 0; i < points.size(); ++i)
      for (std::size_t j = 0; j <= i; ++j) {
        const ContactPoint &p = points[i], &q = points[j];
        const double exact =
            kept.scale(i) * kept.scale(j) * p.normal.dot(block.between(p.slot, q.slot) * q.normal);
        ASSERT_NEAR(static_cast<double>(kept.between(i, j)), exact, 1e-5) << tick << ' ' << i << ' ' << j;
        whole(static_cast<int>(kept.row_of(i)), static_cast<int>(kept.row_of(j))) = exact;
        whole(static_cast<int>(kept.row_of(j)), static_cast<int>(kept.row_of(i))) = exact;
      }
    EXPECT_GE(static_cast<double>(kept.norm()) * (1 + 1e-5),
              Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(whole).eigenvalues().maxCoeff());
    // Of rows of G made from the elements there are, G A G^T has a diagonal of 1, and the trace of A G^T G.
    double trace = 0;
    std::vector<float> unit(kept.size()), z(kept.size());
    for (std::size_t i = 0; i < kept.size(); ++i) {
      unit[i] = 1, kept.inverse().apply(kept.size(), unit.data(), z.data()), unit[i] = 0;
      for (std::size_t j = 0; j < kept.size(); ++j)
        trace += static_cast<double>(kept.values()[std::max(i, j) * kept.ld() + std::min(i, j)] * z[j]);
    }
    // Less where a node's points hardly differ; and some have turned by little.
    EXPECT_LT(trace, static_cast<double>(kept.size()) + 0.2) << tick;
    EXPECT_GT(trace, static_cast<double>(kept.size()) - 2.5) << tick;
  }
  EXPECT_GT(changed, 200u);
}

// The last slots go, and come back with the node they had while others have changed.
TEST(NormalCompliance, RowsThatComeBackKnowWhatChanged) {
  std::mt19937 random(6);
  const Compliance c = some_compliance(random);
  ContactBlock block(rows, 0, rows);
  NormalCompliance kept(block.plane(), rows);
  std::vector<Vec3> normal(rows);
  for (Vec3& n : normal) n = Vec3::Random().normalized();
  std::vector<Index> wanted;
  for (int tick = 0; tick < 1000; ++tick) {
    for (int k = 0; k < 3; ++k) {
      const auto row = static_cast<Index>(random() % rows);
      if (std::erase(wanted, row) == 0 && wanted.size() < rows / 2) wanted.push_back(row);
    }
    if (tick % 50 == 49) wanted.resize(std::min<std::size_t>(wanted.size(), 4));
    block.require(c, wanted);
    std::vector<ContactPoint> points(wanted.size());
    for (std::size_t k = 0; k < wanted.size(); ++k)
      points[k].row = wanted[k], points[k].slot = block.slot_of(wanted[k]),
      points[k].normal = normal[static_cast<std::size_t>(wanted[k])];
    kept.update(block, points, 1e-4);
    for (std::size_t i = 0; i < points.size(); ++i)
      for (std::size_t j = 0; j < i; ++j) {
        const double exact =
            kept.scale(i) * kept.scale(j) *
            points[i].normal.dot(block.between(points[i].slot, points[j].slot) * points[j].normal);
        ASSERT_NEAR(static_cast<double>(kept.between(i, j)), exact, 1e-5) << tick;
      }
  }
}

double largest_eigenvalue(const Eigen::MatrixXd& a) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues().maxCoeff();
}

// Of many points all are made at once where many turn, from 16 bits; where they must be exact, they are.
TEST(NormalCompliance, OfManyIsRoughWhereThatIsAllowed) {
  constexpr std::size_t many = 220;
  std::mt19937 random(8);
  const Compliance c = some_compliance(random, many);
  ContactBlock block(many, 0, many, 1);
  NormalCompliance kept(block.plane(), many + 1);
  std::vector<ContactPoint> points(many);
  std::vector<Index> wanted;
  for (std::size_t k = 0; k < many; ++k)
    points[k].row = static_cast<Index>(k), wanted.push_back(points[k].row);
  block.require(c, wanted);
  for (ContactPoint& p : points) p.slot = block.slot_of(p.row), p.normal = Vec3::Random().normalized();
  const auto exact = [&] {
    return Eigen::MatrixXd(Eigen::MatrixXd::NullaryExpr(
        static_cast<Eigen::Index>(points.size()), static_cast<Eigen::Index>(points.size()),
        [&](Eigen::Index row, Eigen::Index column) {
          const auto i = static_cast<std::size_t>(row), j = static_cast<std::size_t>(column);
          const Mat3 between = block.between(points[i].slot, points[j].slot);
          return kept.scale(i) * kept.scale(j) * points[i].normal.dot(between * points[j].normal);
        }));
  };
  const auto off = [&](const Eigen::MatrixXd& a) {
    double most = 0;
    for (int i = 0; i < a.rows(); ++i)
      for (int j = 0; j < i; ++j)
        most = std::max(most, std::abs(static_cast<double>(kept.between(static_cast<std::size_t>(i),
                                                                        static_cast<std::size_t>(j))) -
                                       a(i, j)));
    return most;
  };
  kept.update(block, points, 0.02);
  Eigen::MatrixXd a = exact();
  EXPECT_LT(off(a), 6e-5);
  EXPECT_GT(off(a), 1e-6);  // it was rough
  EXPECT_GE(static_cast<double>(kept.norm()) * (1 + 1e-4), largest_eigenvalue(a));
  kept.update(block, points, 0);  // though nothing has turned
  EXPECT_LT(off(a), 1e-6);
  // Some turn by little, more of them by more.
  for (int tick = 0; tick < 20; ++tick) {
    for (std::size_t k = 0; k < many; ++k) {
      const double by = static_cast<int>(k) % 7 == tick % 7 ? 0.03 : k % 2 ? 0.004 : 0;
      points[k].normal = (points[k].normal + by * points[k].normal.unitOrthogonal()).normalized();
    }
    kept.update(block, points, 0.02);
    a = exact();
    EXPECT_LT(off(a), 2 * 0.02 + 6e-5) << tick;
    EXPECT_GE(static_cast<double>(kept.norm()) * 1.02, largest_eigenvalue(a)) << tick;
  }
  // What may hardly differ: two points of a node, and places.
  points.push_back(points[3]), points.back().normal = Vec3(points[3].normal + Vec3(1e-3, 0, 0)).normalized();
  kept.update(block, points, 0.02);
  for (std::size_t j = 0; j + 1 < points.size(); ++j)
    EXPECT_NEAR(static_cast<double>(kept.between(many, j)), exact()(many, static_cast<int>(j)), 0.04 + 1e-6);
  EXPECT_LT(kept.between(many, 3), 1);
  points.back().slot = block.combine({points[3].slot, points[4].slot, -1}, Vec3(0.999, 1e-3, 0));
  points.back().normal = points[3].normal;
  for (int turn = 0; turn < 2; ++turn)
    for (ContactPoint& p : points) p.normal = (p.normal + 0.03 * p.normal.unitOrthogonal()).normalized();
  kept.update(block, points, 0.02);
  EXPECT_LT(off(exact()), 1e-6);
}

// Many points of few nodes, right after others had all slots.
TEST(NormalCompliance, HasRoomForAllPointsOfFewNodes) {
  constexpr std::size_t many = 48;
  std::mt19937 random(9);
  const Compliance c = some_compliance(random, many);
  ContactBlock block(many, 0, many);
  NormalCompliance kept(block.plane(), many);
  std::vector<Index> wanted(many);
  for (std::size_t k = 0; k < many; ++k) wanted[k] = static_cast<Index>(k);
  block.require(c, wanted);
  block.require(c, std::span(wanted).last(many / 4));
  std::vector<ContactPoint> points(many);
  for (std::size_t k = 0; k < many; ++k) {
    points[k].row = wanted[many - 1 - k / 4], points[k].slot = block.slot_of(points[k].row);
    points[k].normal = Vec3::Random().normalized();
  }
  kept.update(block, points, 0);
  EXPECT_GT(kept.size(), block.plane() + 2 * many / 3);
  EXPECT_LE(kept.size(), kept.ld());
}

TEST(NormalCompliance, RowsStayWhileNormalsHardlyTurn) {
  std::mt19937 random(6);
  const Compliance c = some_compliance(random);
  ContactBlock block(rows, 0, rows);
  NormalCompliance kept(block.plane(), rows);
  std::vector<ContactPoint> points(10);
  std::vector<Index> wanted;
  for (std::size_t k = 0; k < points.size(); ++k)
    points[k].row = static_cast<Index>(3 * k), wanted.push_back(points[k].row),
    points[k].normal = Vec3::UnitZ();
  block.require(c, wanted);
  for (ContactPoint& p : points) p.slot = block.slot_of(p.row);
  kept.update(block, points, 0.02);
  const float before = kept.between(4, 2);
  points[4].normal = Vec3(0.019, 0, 1).normalized();
  kept.update(block, points, 0.02);
  EXPECT_EQ(kept.between(4, 2), before);
  points[4].normal = Vec3(0.021, 0, 1).normalized();
  kept.update(block, points, 0.02);
  EXPECT_NE(kept.between(4, 2), before);
}

TEST(ProjectedGradients, ProductsAreThoseOfTheWholeMatrix) {
  std::mt19937 random(7);
  for (const std::size_t n : {1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 31, 100, 139}) {
    const std::size_t ld = (n + 31) / 16 * 16;
    std::vector<float> a(n * ld, 1e30f), x(ld), y(ld, 1e30f);  // beyond the squares of eight nothing is read
    Eigen::MatrixXd whole(static_cast<int>(n), static_cast<int>(n));
    Eigen::VectorXd v(static_cast<int>(n));
    for (std::size_t i = 0; i < n; ++i) {
      x[i] = static_cast<float>(random() % 1000) / 1000 - 0.5f,
      v[static_cast<int>(i)] = static_cast<double>(x[i]);
      for (std::size_t j = 0; j <= i; ++j) {
        a[i * ld + j] = static_cast<float>(random() % 1000) / 1000;
        whole(static_cast<int>(i), static_cast<int>(j)) = whole(static_cast<int>(j), static_cast<int>(i)) =
            static_cast<double>(a[i * ld + j]);
        if (j >= i / 8 * 8) a[j * ld + i] = a[i * ld + j];
      }
      for (std::size_t j = n; j < (n + 7) / 8 * 8; ++j) a[i * ld + j] = 1;
    }
    multiply_symmetric(a.data(), n, ld, x.data(), y.data());
    const Eigen::VectorXd exact = whole * v;
    for (std::size_t i = 0; i < n; ++i)
      ASSERT_NEAR(static_cast<double>(y[i]), exact[static_cast<int>(i)], 2e-5) << n << ' ' << i;
  }
}

}  // namespace
}  // namespace palpate
