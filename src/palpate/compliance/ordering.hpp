// Fill-reducing ordering by nested dissection. Karypis, Kumar, "A fast and high quality multilevel scheme for
// partitioning irregular graphs" (1998).
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "palpate/base/vec.hpp"

namespace palpate {

// Order of elimination of the nodes (3 unknowns each) of a symmetric matrix: order[k] is eliminated k-th.
// Reproducible: METIS uses the global rand(), which is seeded under a mutex.
std::vector<Index> nested_dissection(const Eigen::SparseMatrix<double>& matrix);

}  // namespace palpate
