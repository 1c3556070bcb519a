// Lanczos' method with full reorthogonalisation. Lanczos, "An iteration method for the solution of the
// eigenvalue problem" (1950); Parlett, "The symmetric eigenvalue problem" (1998).
#include <Eigen/Eigenvalues>
#include <numeric>
#include <random>

#include "palpate/compliance/hierarchical.hpp"
#include "palpate/compliance/storage.hpp"

namespace palpate {

namespace {

using Vector = Eigen::VectorXd;

// What float32 leaves open: nodes on a stiff region move as one, and their exact compliance is singular to
// it.
constexpr double rounding = 2e-6;

// B = L^-1 C L^-T, L L^T the leaves' own blocks; the diagonal of C raised by `rounding` of a leaf's trace.
class Scaled {
 public:
  explicit Scaled(const HierarchicalCompliance& c) : c_(c), h_(c.matrix()) {
    for (const auto& b : h_.blocks) {
      if (b.row != b.column) continue;
      const auto n = static_cast<Eigen::Index>(h_.unknowns(static_cast<std::size_t>(b.row)));
      Eigen::MatrixXd own =
          Eigen::Map<const Eigen::MatrixXf>(h_.values.data() + b.values, n, n).cast<double>();
      shift_.push_back(rounding * own.trace());
      own.diagonal().array() += shift_.back();
      factors_.emplace_back(own);
      begin_.push_back(static_cast<Eigen::Index>(3 * h_.begin(static_cast<std::size_t>(b.row))));
      good_ = good_ && factors_.back().info() == Eigen::Success;
    }
  }
  bool good() const { return good_; }
  Vector apply(Vector v) const {
    Vector shifted(v.size());
    for (std::size_t i = 0; i < factors_.size(); ++i) {
      auto part = v.segment(begin_[i], factors_[i].rows());
      factors_[i].matrixU().solveInPlace(part);
      shifted.segment(begin_[i], part.size()) = shift_[i] * part;
    }
    const std::size_t n = 3 * h_.nodes;
    std::vector<float> f(n), u(n);  // f in the order of the places
    for (std::size_t k = 0; k < n; ++k) f[k] = static_cast<float>(v[static_cast<Eigen::Index>(k)]);
    c_.apply(h_.order, f, u);
    for (std::size_t p = 0; p < h_.nodes; ++p)
      for (std::size_t a = 0; a < 3; ++a)
        v[static_cast<Eigen::Index>(3 * p + a)] =
            static_cast<double>(u[3 * static_cast<std::size_t>(h_.order[p]) + a]);
    v += shifted;
    for (std::size_t i = 0; i < factors_.size(); ++i) {
      auto part = v.segment(begin_[i], factors_[i].rows());
      factors_[i].matrixL().solveInPlace(part);
    }
    return v;
  }

 private:
  const HierarchicalCompliance& c_;
  const Hierarchical& h_;
  std::vector<Eigen::LLT<Eigen::MatrixXd>> factors_;
  std::vector<Eigen::Index> begin_;
  std::vector<double> shift_;
  bool good_ = true;
};

}  // namespace

double lowest_eigenvalue(const HierarchicalCompliance& compliance) {
  const Scaled scaled(compliance);
  if (!scaled.good()) return -1;
  const auto n = static_cast<Eigen::Index>(3 * compliance.nodes());
  const Eigen::Index most = std::min<Eigen::Index>(n, 160);
  Eigen::MatrixXd basis(n, most);
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  Vector v = Vector::NullaryExpr(n, [&] { return normal(random); });
  Vector diagonal(most), beside(most);
  double lowest = 0;
  for (Eigen::Index k = 0; k < most; ++k) {
    basis.col(k) = v.normalized();
    v = scaled.apply(basis.col(k));
    diagonal[k] = basis.col(k).dot(v);
    for (int twice = 0; twice < 2; ++twice)
      v -= basis.leftCols(k + 1) * (basis.leftCols(k + 1).transpose() * v);
    beside[k] = v.norm();
    const bool ended = k + 1 == most || beside[k] < 1e-9;
    if (!ended && k % 10 != 9) continue;
    Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen;
    eigen.computeFromTridiagonal(diagonal.head(k + 1), beside.head(k));
    lowest = eigen.eigenvalues()[0];
    if (ended || lowest <= 0 || beside[k] * std::abs(eigen.eigenvectors()(k, 0)) < 0.05 * lowest) break;
  }
  return lowest;
}

}  // namespace palpate
