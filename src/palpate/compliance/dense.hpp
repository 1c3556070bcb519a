// Names for the few dense kernels of OpenBLAS that are used, for both precisions. Column-major throughout;
// L is lower triangular, not unit; sizes are checked by who calls.
#pragma once

#include <cblas.h>

#include <algorithm>
#include <cstddef>

extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void dtrtri_(const char* uplo, const char* diag, const int* n, double* a, const int* lda, int* info);
}

namespace palpate::dense {

using Size = std::size_t;
inline int blas(Size n) { return static_cast<int>(n); }

// A = L L^T in place (lower triangle). Number of the first bad pivot, counted from 1; 0: all went well.
inline int cholesky(Size n, double* a, Size lda) {
  const int order = blas(n), leading = blas(lda);
  int info = 0;
  dpotrf_("L", &order, a, &leading, &info);
  return info;
}

// Y <- (Y - X B) L^-1: Y m x n, X m x b, the panel (n + b) x n holds L above B.
inline void solve_back(Size m, Size n, Size b, const double* panel, Size ldp, const double* x, double* y) {
  if (b > 0)
    cblas_dgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, blas(m), blas(n), blas(b), -1, x, blas(m),
                panel + n, blas(ldp), 1, y, blas(m));
  cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasNoTrans, CblasNonUnit, blas(m), blas(n), 1, panel,
              blas(ldp), y, blas(m));
}

// C <- alpha A B^T + beta C: C m x n, A m x k, B n x k.
inline void multiply(Size m, Size n, Size k, double alpha, const double* a, Size lda, const double* b,
                     Size ldb, double beta, double* c, Size ldc) {
  cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, blas(m), blas(n), blas(k), alpha, a, blas(lda), b,
              blas(ldb), beta, c, blas(ldc));
}
inline void multiply(Size m, Size n, Size k, float alpha, const float* a, Size lda, const float* b, Size ldb,
                     float beta, float* c, Size ldc) {
  cblas_sgemm(CblasColMajor, CblasNoTrans, CblasTrans, blas(m), blas(n), blas(k), alpha, a, blas(lda), b,
              blas(ldb), beta, c, blas(ldc));
}

// C <- alpha A A^T + beta C, one triangle: C n x n, A n x k.
inline void square(bool lower, Size n, Size k, double alpha, const double* a, Size lda, double beta,
                   double* c, Size ldc) {
  cblas_dsyrk(CblasColMajor, lower ? CblasLower : CblasUpper, CblasNoTrans, blas(n), blas(k), alpha, a,
              blas(lda), beta, c, blas(ldc));
}
inline void square(bool lower, Size n, Size k, float alpha, const float* a, Size lda, float beta, float* c,
                   Size ldc) {
  cblas_ssyrk(CblasColMajor, lower ? CblasLower : CblasUpper, CblasNoTrans, blas(n), blas(k), alpha, a,
              blas(lda), beta, c, blas(ldc));
}

// OpenBLAS' dtrsm from the right reaches a third of its dgemm. So the inverses of the diagonal's blocks are
// kept, and all is dgemm: `inverse` holds the blocks of L one after the other, inverse_block x n numbers.
constexpr Size inverse_block = 32;

inline void invert_blocks(Size n, const double* l, Size ldl, double* inverse) {
  for (Size c = 0; c < n; c += inverse_block) {
    const int size = blas(std::min(inverse_block, n - c)), leading = blas(inverse_block);
    double* block = inverse + c * inverse_block;
    for (Size j = 0; j < static_cast<Size>(size); ++j)
      for (Size i = 0; i < static_cast<Size>(size); ++i)
        block[j * inverse_block + i] = i < j ? 0 : l[(c + j) * ldl + c + i];
    int info = 0;
    dtrtri_("L", "N", &size, block, &leading, &info);
  }
}

// X <- X L^-T: X m x n; work: m x inverse_block.
inline void solve_right(Size m, Size n, const double* l, Size ldl, const double* inverse, double* x, Size ldx,
                        double* work) {
  for (Size c = 0; c < n; c += inverse_block) {
    const Size size = std::min(inverse_block, n - c), next = c + size;
    multiply(m, size, size, 1.0, x + c * ldx, ldx, inverse + c * inverse_block, inverse_block, 0.0, work, m);
    for (Size j = 0; j < size; ++j) std::copy_n(work + j * m, m, x + (c + j) * ldx);
    if (next < n)
      multiply(m, n - next, size, -1.0, x + c * ldx, ldx, l + c * ldl + next, ldl, 1.0, x + next * ldx, ldx);
  }
}

}  // namespace palpate::dense
