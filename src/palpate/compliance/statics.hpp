// Linear statics: the displacement under nodal forces with some displacements given.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "palpate/base/progress.hpp"

namespace palpate {

// K u = force where free; where fixed[i] (one an unknown) the entry of u is given and stays. stiffness:
// symmetric, both triangles stored, 3 unknowns a node, N/m; force N, u m. Throws NotPositiveDefinite where
// the body can still move freely.
void solve_statics(const Eigen::SparseMatrix<double>& stiffness, const std::vector<bool>& fixed,
                   const Eigen::VectorXd& force, Eigen::VectorXd& u, int threads = 0,
                   const Progress& progress = {});

}  // namespace palpate
