// The storages against the dense matrix in float64, and their certificate.
#include "palpate/compliance/storage.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <thread>

#include "palpate/base/error.hpp"
#include "palpate/base/half.hpp"
#include "palpate/compliance/ordering.hpp"
#include "palpate/compliance/rows.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "palpate/geometry/shapes.hpp"
#include "unit/compliance/systems.hpp"

namespace palpate {
namespace {

// A block of 10 cm, its base held, its upper part `contrast` times as stiff.
struct Body {
  Factored<float> factored;
  Eigen::MatrixXd exact;
  std::vector<Vec3> positions;
};

Body make_body(int cells, double poisson, double contrast = 1) {
  TetMesh mesh = make_block({Vec3::Zero(), Vec3::Constant(0.1)}, {cells, cells, cells});
  mesh.region_names = {"lower", "upper"};
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    double z = 0;
    for (const Index node : mesh.tets[t]) z += mesh.nodes[static_cast<std::size_t>(node)].z() / 4;
    mesh.regions[t] = z > 0.08;
  }
  std::vector<std::uint8_t> anchored;
  for (const Vec3& x : mesh.nodes) anchored.push_back(x.z() < 1e-6);
  const FreeStiffness k = remove_anchored(
      assemble_stiffness(mesh, {{1e4, poisson, 1000}, {contrast * 1e4, poisson, 1000}}), anchored);
  Body body;
  std::vector<Index> nodes;
  for (const Index node : boundary(mesh).nodes)
    if (const Index free = k.free_of[static_cast<std::size_t>(node)]; free >= 0) {
      nodes.push_back(free);
      body.positions.push_back(mesh.nodes[static_cast<std::size_t>(node)]);
    }
  const Sparse loads = unit_loads(static_cast<std::size_t>(k.matrix.cols()) / 3, nodes);
  const Cholesky cholesky(k.matrix, nested_dissection(k.matrix), 1);
  body.factored = factor_compliance<float>(cholesky, loads, 1, {});
  const auto n = static_cast<Eigen::Index>(3 * nodes.size());
  body.exact.resize(n, n);
  compliance_sweep<double>(cholesky, nodes, {body.exact.data(), static_cast<std::size_t>(body.exact.size())},
                           1);
  return body;
}

Compliance make(Storage storage, int cells, double tolerance = 1e-3) {
  Body body = make_body(cells, 0.45);
  if (storage == Storage::factored)
    return Compliance(std::make_shared<FactoredCompliance>(std::move(body.factored)));
  if (storage == Storage::hierarchical)
    return Compliance(
        std::make_shared<HierarchicalCompliance>(compress(body.factored, body.positions, tolerance, 1)));
  const Eigen::MatrixXf exact = body.exact.cast<float>();
  HugeArray<float> matrix(static_cast<std::size_t>(exact.size()));
  std::copy_n(exact.data(), exact.size(), matrix.data());
  if (storage == Storage::half) return Compliance(std::make_shared<HalfCompliance>(matrix));
  return Compliance::dense(std::move(matrix), body.positions.size());
}

Eigen::MatrixXf all_of(const Compliance& c) {
  std::vector<Index> nodes(c.nodes());
  for (std::size_t i = 0; i < nodes.size(); ++i) nodes[i] = static_cast<Index>(i);
  const auto n = static_cast<Eigen::Index>(3 * c.nodes());
  Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> out(n, n);
  c.block(nodes, {out.data(), static_cast<std::size_t>(out.size())}, static_cast<std::size_t>(n));
  return out;
}

class Storages : public ::testing::TestWithParam<Storage> {};

TEST_P(Storages, BlockApplyAndRowAgreeWithTheDenseMatrix) {
  constexpr int cells = 9;
  const Compliance c = make(GetParam(), cells);
  const Body body = make_body(cells, 0.45);
  ASSERT_EQ(c.nodes(), body.positions.size());
  const double tolerance = GetParam() == Storage::hierarchical ? 1e-3
                           : GetParam() == Storage::half       ? 5e-4
                                                               : 1e-6;
  const Eigen::MatrixXf all = all_of(c);
  // Hierarchical: the tolerance is of blocks' norms; single entries are further off than these.
  EXPECT_LT(scaled_error(all, body.exact), GetParam() == Storage::hierarchical ? 5 * tolerance : tolerance);
  EXPECT_EQ(Eigen::LLT<Eigen::MatrixXd>(all.cast<double>()).info(), Eigen::Success);
  EXPECT_TRUE(!c.mirrors_bits() || all == all.transpose());
  EXPECT_EQ(c.mirrors_bits(), GetParam() == Storage::dense || GetParam() == Storage::half);

  std::mt19937 random(5);
  for (const std::size_t contacts : {0, 1, 2, 7, 8, 9, 100}) {
    std::vector<Index> nodes;
    Eigen::VectorXd f = Eigen::VectorXd::Zero(body.exact.rows());
    std::vector<float> forces;
    while (nodes.size() < contacts) {
      const auto node = static_cast<Index>(random() % c.nodes());
      if (std::find(nodes.begin(), nodes.end(), node) != nodes.end()) continue;
      nodes.push_back(node);
      for (Index a = 0; a < 3; ++a) {
        forces.push_back(static_cast<float>(random() % 1000) * 1e-3f);
        f[3 * node + a] = static_cast<double>(forces.back());
      }
    }
    std::vector<float> u(3 * c.nodes(), 7.0f), again(u);
    c.apply(nodes, forces, u);
    const Eigen::VectorXd expected = body.exact * f;
    const Eigen::Map<const Eigen::VectorXf> result(u.data(), static_cast<Eigen::Index>(u.size()));
    EXPECT_LE((result.cast<double>() - expected).norm(), tolerance * expected.norm()) << contacts;
    // Rectangles are parts of the whole; the padding is left alone.
    const std::vector<Index> rows(nodes.begin(), nodes.begin() + static_cast<std::ptrdiff_t>(contacts / 3));
    const std::size_t ld = 3 * contacts + 2;
    std::vector<float> block(3 * rows.size() * ld + 1, 9.0f);
    c.block(rows, nodes, block, ld);
    for (std::size_t i = 0; i < 3 * rows.size(); ++i)
      for (std::size_t j = 0; j < ld; ++j) {
        if (j >= 3 * contacts) {
          EXPECT_EQ(block[i * ld + j], 9.0f);
          continue;
        }
        const auto row = 3 * rows[i / 3] + static_cast<Index>(i % 3),
                   column = 3 * nodes[j / 3] + static_cast<Index>(j % 3);
        ASSERT_NEAR(block[i * ld + j], all(row, column),
                    1e-6f * std::sqrt(all(row, row) * all(column, column)));
      }
  }
  std::vector<float> row(3 * c.nodes());
  c.row(17, row);
  for (std::size_t j = 0; j < row.size(); ++j)
    ASSERT_NEAR(row[j], all(17, static_cast<Index>(j)), 1e-6f * all.maxCoeff());
}

TEST_P(Storages, ManyThreadsMayAsk) {
  const Compliance c = make(GetParam(), 6);
  const std::vector<Index> nodes = {3, 50, 7, 120};
  const std::vector<float> f(12, 0.25f);
  std::vector<float> expected(3 * c.nodes());
  c.apply(nodes, f, expected);
  std::vector<std::jthread> threads;
  std::vector<int> wrong(4, 0);
  for (std::size_t t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      std::vector<float> u(expected.size()), block(144);
      for (int i = 0; i < 20; ++i) {
        c.block(nodes, block, 12);
        c.apply(nodes, f, u);
        wrong[t] += u != expected;
      }
    });
  threads.clear();
  EXPECT_EQ(wrong, std::vector<int>(4, 0));
}

std::string name_of(const ::testing::TestParamInfo<Storage>& tested) {
  const char* const words[] = {"Dense", "Half", "Factored", "Hierarchical"};
  return words[static_cast<int>(tested.param)];
}
INSTANTIATE_TEST_SUITE_P(All, Storages,
                         ::testing::Values(Storage::dense, Storage::half, Storage::factored,
                                           Storage::hierarchical),
                         name_of);

TEST(Half, IsRoundedToNearestAndBack) {
  for (std::uint32_t h = 0; h < 0x10000; ++h) {
    const auto half = static_cast<std::uint16_t>(h);
    const float value = from_half(half);
    if ((h & 0x7fffu) > 0x7c00u) {
      EXPECT_TRUE(std::isnan(value) && std::isnan(from_half(to_half(value))));
      continue;
    }
    ASSERT_EQ(to_half(value), half);
    if ((h & 0x7fffu) >= 0x7bffu) continue;
    const float next = from_half(static_cast<std::uint16_t>(h + 1)), middle = 0.5f * (value + next);
    ASSERT_EQ(to_half(middle), h + (h & 1)) << "ties to even";
    ASSERT_EQ(to_half(std::nextafter(middle, value)), half);
    ASSERT_EQ(to_half(std::nextafter(middle, next)), h + 1);
  }
  EXPECT_EQ(from_half(0x3c00), 1.0f);
  EXPECT_EQ(to_half(70000.0f), 0x7c00);
}

TEST(Rows, HalfAndFloatGiveTheSameSums) {
  std::mt19937 random(8);
  for (const std::size_t count : {1, 2, 3, 5, 6, 9, 23, 24})
    for (const std::size_t n : {1, 15, 16, 17, 40, 100}) {
      std::vector<std::uint16_t> half(count * n);
      std::vector<float> whole(count * n), weights(count), a(n, 0.5f), b(a), c(a);
      for (auto& h : half) h = to_half(static_cast<float>(random() % 2000) * 1e-3f - 1);
      for (std::size_t i = 0; i < half.size(); ++i) whole[i] = from_half(half[i]);
      for (auto& w : weights) w = static_cast<float>(random() % 100) * 0.37f;
      const std::uint16_t* h[rows_at_once];
      const float* f[rows_at_once];
      for (std::size_t k = 0; k < count; ++k) h[k] = half.data() + k * n, f[k] = whole.data() + k * n;
      add_rows(h, weights.data(), count, n, a.data());
      add_rows(f, weights.data(), count, n, b.data());
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t k = 0; k < count; ++k) c[i] += weights[k] * whole[k * n + i];
      ASSERT_EQ(a, b);
      ASSERT_EQ(b, c) << "in the order of k, without fused operations";
    }
}

// The true error of each block, by dense algebra.
std::vector<double> true_errors(const Hierarchical& h, const Eigen::MatrixXf& stored,
                                const Eigen::MatrixXd& exact) {
  const auto part = [&](const auto& matrix, std::size_t r, std::size_t c) -> Eigen::MatrixXd {
    return Eigen::MatrixXd::NullaryExpr(
        static_cast<Index>(h.unknowns(r)), static_cast<Index>(h.unknowns(c)), [&](Index i, Index j) {
          return static_cast<double>(
              matrix(3 * h.order[h.begin(r) + static_cast<std::size_t>(i / 3)] + i % 3,
                     3 * h.order[h.begin(c) + static_cast<std::size_t>(j / 3)] + j % 3));
        });
  };
  const auto norm = [](const Eigen::MatrixXd& m) {
    const Eigen::MatrixXd gram = m.transpose() * m;
    return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(gram, Eigen::EigenvaluesOnly)
                         .eigenvalues()
                         .maxCoeff());
  };
  std::vector<double> out;
  for (const auto& b : h.blocks) {
    const auto r = static_cast<std::size_t>(b.row), c = static_cast<std::size_t>(b.column);
    const Eigen::MatrixXd e = part(stored, r, c) - part(exact, r, c);
    out.push_back(norm(e) / std::sqrt(norm(part(exact, r, r)) * norm(part(exact, c, c))));
  }
  return out;
}

TEST(Hierarchical, TheCertificateBoundsTheErrorOfEveryBlock) {
  const Body body = make_body(12, 0.45);
  for (const double tolerance : {1e-2, 1e-3, 1e-4}) {
    Hierarchical h = compress(body.factored, body.positions, tolerance, 1);
    EXPECT_LE(h.error, tolerance);
    EXPECT_GT(h.lowest, 0);
    std::size_t far = 0;
    for (const auto& b : h.blocks) far += !b.near;
    ASSERT_GT(far, 50u);
    const std::vector<double> certified = block_errors(h, body.factored, 1);
    const HierarchicalCompliance compliance(std::move(h));
    const Compliance view(std::shared_ptr<const ComplianceStorage>(std::shared_ptr<void>(), &compliance));
    const std::vector<double> errors = true_errors(compliance.matrix(), all_of(view), body.exact);
    for (std::size_t b = 0; b < errors.size(); ++b) EXPECT_LE(errors[b], certified[b] + 1e-6) << b;
  }
}

TEST(Hierarchical, TheCertificateSeesOneBlockOffByFivePercent) {
  const Body body = make_body(12, 0.45);
  Hierarchical h = compress(body.factored, body.positions, 1e-3, 1);
  std::size_t near = 0, far = 0;
  for (std::size_t i = 0; i < h.blocks.size(); ++i) {
    const auto& b = h.blocks[i];
    if (i % 41 != 0) continue;
    const std::size_t end = i + 1 < h.blocks.size() ? h.blocks[i + 1].values : h.values.size();
    for (std::size_t k = b.values; k < end; ++k) h.values[k] *= 1.05f;
    const std::vector<double> errors = block_errors(h, body.factored, 1);
    EXPECT_GT(errors[i], 1e-3) << "block " << i;
    for (std::size_t j = 0; j < errors.size(); ++j) EXPECT_TRUE(j == i || errors[j] <= 1e-3) << j;
    for (std::size_t k = b.values; k < end; ++k) h.values[k] /= 1.05f;
    ++(b.near ? near : far);
  }
  EXPECT_GT(near, 2u);
  EXPECT_GT(far, 2u);
}

TEST(Hierarchical, TheMemoryItTakesIsKnownBefore) {
  const Body body = make_body(10, 0.45);
  Factored<float> outline;
  outline.branches = body.factored.branches, outline.load_at = body.factored.load_at;
  std::size_t before = 0;
  for (const double tolerance : {3e-2, 1e-3, 1e-5}) {
    const std::size_t bytes = compress_bytes(outline, body.positions, tolerance, 1);
    const Hierarchical h = compress(body.factored, body.positions, tolerance, 1);
    EXPECT_GT(bytes, before);
    EXPECT_GT(bytes, sizeof(float) * h.values.size());
    EXPECT_LT(bytes, 30'000'000 + 20 * sizeof(float) * h.values.size());
    before = bytes;
  }
  EXPECT_GT(compress_bytes(outline, body.positions, 1e-3, 2),
            compress_bytes(outline, body.positions, 1e-3, 1));
}

TEST(Hierarchical, StopsWhereverItIsInterrupted) {
  const Body body = make_body(8, 0.45);
  for (const double when : {0.0, 0.1, 0.3, 0.5}) {
    std::atomic<bool> stop{false};
    Progress progress;
    progress.interrupted = &stop;
    progress.report = [&](double f) { stop = stop || f >= when; };
    try {
      compress(body.factored, body.positions, 1e-3, 2, progress);
      ADD_FAILURE() << when;
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::interrupted);
    }
  }
}

TEST(Hierarchical, SmallerToleranceMoreNumbersAndSameBitsForAnyThreads) {
  const Body body = make_body(10, 0.45);
  std::size_t size = 0;
  for (const double tolerance : {3e-2, 3e-3, 3e-4}) {
    const Hierarchical h = compress(body.factored, body.positions, tolerance, 1);
    EXPECT_GT(h.values.size(), size);
    size = h.values.size();
  }
  const Hierarchical one = compress(body.factored, body.positions, 1e-3, 1),
                     two = compress(body.factored, body.positions, 1e-3, 2);
  EXPECT_EQ(one.rank, two.rank);
  EXPECT_TRUE(std::equal(one.values.data(), one.values.data() + one.values.size(), two.values.data(),
                         two.values.data() + two.values.size()));
  EXPECT_EQ(one.error, two.error);
  EXPECT_THROW(compress(body.factored, body.positions, 1e-9, 1), Error);
}

// Nearly incompressible, and a stiff part on top: still positive definite, whatever the tolerance.
TEST(Hierarchical, StaysPositiveDefinite) {
  for (const auto& [poisson, contrast] :
       {std::pair(0.499, 1.0), std::pair(0.4999, 1.0), std::pair(0.45, 1e6)}) {
    const Body body = make_body(8, poisson, contrast);
    const HierarchicalCompliance compliance{compress(body.factored, body.positions, 0.05, 1)};
    // What keeps to the tolerance is not enough for the first two: it had to tighten.
    EXPECT_TRUE(poisson < 0.49 || compliance.matrix().error < 0.01);
    const Compliance view(std::shared_ptr<const ComplianceStorage>(std::shared_ptr<void>(), &compliance));
    Eigen::MatrixXd all = all_of(view).cast<double>();
    all.diagonal() *= 1 + 2e-4;  // rounding on the stiff part
    EXPECT_EQ(Eigen::LLT<Eigen::MatrixXd>(0.5 * (all + all.transpose())).info(), Eigen::Success)
        << poisson << ' ' << contrast << ' ' << compliance.matrix().lowest;
  }
}

TEST(Hierarchical, LanczosFindsTheSmallestEigenvalue) {
  const Body body = make_body(7, 0.45);
  Hierarchical h = compress(body.factored, body.positions, 1e-3, 1);
  const double lowest = h.lowest;
  const HierarchicalCompliance compliance(std::move(h));
  const Compliance view(std::shared_ptr<const ComplianceStorage>(std::shared_ptr<void>(), &compliance));
  const Hierarchical& m = compliance.matrix();
  const Eigen::MatrixXd all = all_of(view).cast<double>();
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(all.rows(), all.cols());
  for (std::size_t leaf = (std::size_t{1} << m.levels) - 1; leaf < m.clusters(); ++leaf)
    for (std::size_t p = m.begin(leaf); p < m.end(leaf); ++p)
      for (std::size_t q = m.begin(leaf); q < m.end(leaf); ++q)
        own.block<3, 3>(3 * m.order[p], 3 * m.order[q]) = all.block<3, 3>(3 * m.order[p], 3 * m.order[q]);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (all + all.transpose()), own,
                                                                        Eigen::EigenvaluesOnly);
  EXPECT_NEAR(lowest, eigen.eigenvalues()[0], 0.1 * eigen.eigenvalues()[0]);
}

}  // namespace
}  // namespace palpate
