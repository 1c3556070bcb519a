// Names for the few dense kernels of OpenBLAS that are used, for both precisions. Column-major throughout;
// L is lower triangular, not unit; sizes are checked by who calls.
#pragma once

#include <cblas.h>

#include <cstddef>

extern "C" void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);

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

// X <- X L^-T: m x n, L n x n.
inline void solve_right(Size m, Size n, const double* l, Size ldl, double* x, Size ldx) {
  cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, blas(m), blas(n), 1, l,
              blas(ldl), x, blas(ldx));
}
inline void solve_right(Size m, Size n, const float* l, Size ldl, float* x, Size ldx) {
  cblas_strsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, blas(m), blas(n), 1, l,
              blas(ldl), x, blas(ldx));
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

}  // namespace palpate::dense
