// A quadratic function over bounds: min 1/2 x.A x + b.x, x >= lower, A symmetric positive definite.
// Dostal, Schoeberl, "Minimizing quadratic functions subject to bound constraints with the rate of
// convergence and finite termination" (2005): conjugate gradients on the free entries, projected steps where
// these meet their bounds; preconditioned in the face of the free ones as in Dostal, Domoradova, Sadowska,
// "Superrelaxation and the rate of convergence in minimizing quadratic functions subject to bound
// constraints" (2011). No factor: from the last tick's answer half a dozen products with A do.
#pragma once

#include <cstddef>
#include <span>

#include "palpate/contact/sparse_inverse.hpp"

namespace palpate {

// y = A x for a symmetric A of which the lower triangle is read, and all of the squares of eight on its
// diagonal (also beyond n, where numbers do not matter): rows one after the other, `ld` apart, whole eights.
// x, y: whole sixteens, zero beyond n. The same bits by every instruction set.
void multiply_symmetric(const float* a, std::size_t n, std::size_t ld, const float* x, float* y) noexcept;

struct GradientWork {
  std::span<float> gradient, way, product, free, downhill;  // whole sixteens of n each
};

// a: n x n as above. norm: an upper bound of A's largest eigenvalue. inverse: about A's; any will do.
// lower, within, x: whole sixteens, zero beyond n. x: a start within the bounds, and the answer. Ends when
// the gradient A x + b is at most within[i] in size where x is free and no less than -within[i] at a bound.
// Returns the number of products with A; -1 when `most` were not enough or A is not positive definite: x is
// then what was reached, within its bounds. work.gradient: A x + b on return.
int minimise_over_bounds(const float* a, std::size_t n, std::size_t ld, float norm,
                         const SparseInverse& inverse, std::span<const float> b, std::span<const float> lower,
                         std::span<const float> within, std::span<float> x, const GradientWork& work,
                         int most = 200) noexcept;

}  // namespace palpate
