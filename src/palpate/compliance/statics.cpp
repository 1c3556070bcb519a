#include "palpate/compliance/statics.hpp"

#include "palpate/compliance/multifrontal.hpp"
#include "palpate/compliance/ordering.hpp"

namespace palpate {

void solve_statics(const Eigen::SparseMatrix<double>& stiffness, const std::vector<bool>& fixed,
                   const Eigen::VectorXd& force, Eigen::VectorXd& u, int threads, const Progress& progress) {
  const auto is_fixed = [&](Eigen::Index i) { return fixed[static_cast<std::size_t>(i)]; };
  for (Eigen::Index i = 0; i < u.size(); ++i)
    if (!is_fixed(i)) u[i] = 0;
  Eigen::VectorXd right = force - stiffness * u;
  // Rows and columns of what is given become the identity's, times K's own size so that no pivot stands out.
  Eigen::SparseMatrix<double> matrix = stiffness;
  matrix.prune([&](Eigen::Index row, Eigen::Index column, double) {
    return row == column || (!is_fixed(row) && !is_fixed(column));
  });
  for (Eigen::Index i = 0; i < u.size(); ++i)
    if (is_fixed(i)) right[i] = matrix.coeff(i, i) * u[i];
  const Cholesky factor(matrix, nested_dissection(matrix), threads, progress);
  factor.solve(std::span<double>(right.data(), static_cast<std::size_t>(right.size())));
  for (Eigen::Index i = 0; i < u.size(); ++i)
    if (!is_fixed(i)) u[i] = right[i];
}

}  // namespace palpate
