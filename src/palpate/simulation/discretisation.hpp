// How far off a model's elements are, by a standard test: two jaws pinch the organ, straight across from what
// holds it, and the answer of its elements is compared with that of a space one order higher (elasticity/
// enrichment.hpp). Ainsworth, Oden, A Posteriori Error Estimation in Finite Element Analysis (2000), ch. 5.
#pragma once

#include "palpate/compliance/multifrontal.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "palpate/simulation/organ.hpp"

namespace palpate {

// Displacements of the pinch in the model's own elements, m, and its figures.
struct PinchResult {
  Discretisation figures;
  Eigen::VectorXd u;  // of the free nodes, 3 a node
  double work = 0;    // of the jaws' forces on u, J
};

// k, factor: the stiffness of the free nodes and its factor. organ: surface, rows and materials set.
// everywhere: higher order in all tetrahedra, not only near the jaws.
PinchResult pinch(const Organ& organ, const ElementNodes& nodes, const FreeStiffness& k,
                  const Cholesky& factor, const Progress& progress = {}, bool everywhere = false);

// Fills the drawing's errors from the pinch: what it shows once the surface nodes are where their readings
// (of `loads`, as baked) put them, against u itself. Nothing where there is no drawing.
void compare_drawing(Organ& organ, const ElementNodes& nodes, const FreeStiffness& k,
                     const Eigen::SparseMatrix<double>& loads, const Eigen::VectorXd& u);

}  // namespace palpate
