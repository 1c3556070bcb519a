#include "palpate/compliance/compliance.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "palpate/base/error.hpp"

namespace palpate {
namespace {

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct Case {
  std::size_t nodes;
  Matrix c;
  Compliance compliance;
  std::vector<Index> contacts;  // out of order
  Eigen::VectorXf forces;
};

Case make_case(std::size_t nodes, std::size_t contacts, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  const auto n = static_cast<Eigen::Index>(3 * nodes);
  Case out{nodes, {}, {}, {}, {}};
  const Matrix a = Matrix::NullaryExpr(n, n, [&] { return uniform(random); });
  out.c = a + a.transpose();
  HugeArray<float> memory(9 * nodes * nodes);
  std::copy_n(out.c.data(), out.c.size(), memory.data());
  out.compliance = Compliance::dense(std::move(memory), nodes);
  std::vector<Index> all(nodes);
  for (std::size_t i = 0; i < nodes; ++i) all[i] = static_cast<Index>(i);
  std::shuffle(all.begin(), all.end(), random);
  out.contacts.assign(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(contacts));
  out.forces =
      Eigen::VectorXf::NullaryExpr(static_cast<Eigen::Index>(3 * contacts), [&] { return uniform(random); });
  return out;
}

Eigen::VectorXd expected(const Case& k) {
  Eigen::VectorXd f = Eigen::VectorXd::Zero(k.c.rows());
  for (std::size_t i = 0; i < k.contacts.size(); ++i)
    f.segment<3>(3 * k.contacts[i]) = k.forces.segment<3>(static_cast<Eigen::Index>(3 * i)).cast<double>();
  return k.c.cast<double>() * f;
}

TEST(Compliance, ApplyIsTheProductForEveryCount) {
  for (std::size_t nodes : {1u, 2u, 7u, 40u, 111u})
    for (std::size_t contacts = 0; contacts <= std::min<std::size_t>(nodes, 13); ++contacts) {
      const Case k = make_case(nodes, contacts, static_cast<unsigned>(nodes + contacts));
      Eigen::VectorXf u = Eigen::VectorXf::Constant(k.c.rows(), 77);
      k.compliance.apply(k.contacts, {k.forces.data(), 3 * contacts}, {u.data(), 3 * nodes});
      EXPECT_LT((u.cast<double>() - expected(k)).cwiseAbs().maxCoeff(), 2e-5) << nodes << ' ' << contacts;
    }
}

TEST(Compliance, BlocksAreTheMatrixEntriesAndLeaveThePaddingAlone) {
  const Case k = make_case(30, 6, 5);
  const std::vector<Index> rows = {29, 3};
  constexpr std::size_t ld = 21;
  std::vector<float> square(18 * ld, -7), rectangle(6 * ld, -7);
  k.compliance.block(k.contacts, square, ld);
  k.compliance.block(rows, k.contacts, rectangle, ld);
  for (std::size_t i = 0; i < 18; ++i)
    for (std::size_t j = 0; j < ld; ++j)
      EXPECT_EQ(square[i * ld + j], j < 18 ? k.c(3 * k.contacts[i / 3] + static_cast<Index>(i % 3),
                                                 3 * k.contacts[j / 3] + static_cast<Index>(j % 3))
                                           : -7);
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = 0; j < ld; ++j)
      EXPECT_EQ(rectangle[i * ld + j], j < 18 ? k.c(3 * rows[i / 3] + static_cast<Index>(i % 3),
                                                    3 * k.contacts[j / 3] + static_cast<Index>(j % 3))
                                              : -7);
}

TEST(Compliance, WrongSizeIsAnError) {
  EXPECT_THROW(Compliance::dense(HugeArray<float>(10), 1), Error);
  EXPECT_EQ(Compliance().nodes(), 0u);
}

}  // namespace
}  // namespace palpate
