#include <Eigen/SparseCore>

#include "palpate/compliance/cholesky_impl.hpp"
#include "palpate/compliance/factored.hpp"
#include "palpate/compliance/multifrontal.hpp"

namespace palpate {

Eigen::SparseMatrix<double> unit_loads(std::size_t all, std::span<const Index> nodes) {
  std::vector<std::uint8_t> used(all, 0);
  Eigen::SparseMatrix<double> loads(static_cast<Index>(3 * all), static_cast<Index>(3 * nodes.size()));
  loads.reserve(3 * nodes.size());
  Index column = 0;
  for (const Index node : nodes) {
    if (node < 0 || static_cast<std::size_t>(node) >= all || used[static_cast<std::size_t>(node)]++)
      throw Error(ErrorKind::internal, "compliance: node {} is repeated or not one of {}", node, all);
    for (Index a = 0; a < 3; ++a) {
      loads.startVec(column);
      loads.insertBack(3 * node + a, column++) = 1;
    }
  }
  loads.finalize();
  return loads;
}

namespace {

Progress share(const Progress& progress, double begin, double end) {
  Progress part{nullptr, progress.interrupted};
  if (progress.report)
    part.report = [=, report = progress.report](double f) { report(begin + f * (end - begin)); };
  return part;
}

}  // namespace

template <class Scalar>
void compliance_sweep(const Cholesky& factor, const Eigen::SparseMatrix<double>& loads, std::span<Scalar> out,
                      int threads, const Progress& progress) {
  const auto factored = factor_compliance<Scalar>(factor, loads, threads, share(progress, 0, 0.3));
  multiply_out(factored, out, threads, share(progress, 0.3, 1));
}

template <class Scalar>
void compliance_sweep(const Cholesky& factor, std::span<const Index> nodes, std::span<Scalar> out,
                      int threads, const Progress& progress) {
  compliance_sweep(factor, unit_loads(factor.impl().symbolic.node_at.size(), nodes), out, threads, progress);
}

template void compliance_sweep(const Cholesky&, const Eigen::SparseMatrix<double>&, std::span<float>, int,
                               const Progress&);
template void compliance_sweep(const Cholesky&, const Eigen::SparseMatrix<double>&, std::span<double>, int,
                               const Progress&);
template void compliance_sweep(const Cholesky&, std::span<const Index>, std::span<float>, int,
                               const Progress&);
template void compliance_sweep(const Cholesky&, std::span<const Index>, std::span<double>, int,
                               const Progress&);

}  // namespace palpate
