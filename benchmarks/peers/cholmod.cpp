#include <cholmod.h>

#include <algorithm>
#include <stdexcept>

#include "peers.hpp"

namespace palpate::peers {

namespace {

class Cholmod final : public Factorisation {
 public:
  explicit Cholmod(const Eigen::SparseMatrix<double>& matrix)
      : lower_(matrix.triangularView<Eigen::Lower>()) {
    cholmod_start(&common_);
    common_.supernodal = CHOLMOD_SUPERNODAL;
    common_.nmethods = 1;
    common_.method[0].ordering = CHOLMOD_METIS;
    common_.postorder = 1;
    lower_.makeCompressed();
  }
  ~Cholmod() override {
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;

  void factor() override {
    cholmod_free_factor(&factor_, &common_);
    cholmod_sparse a = view();
    factor_ = cholmod_analyze(&a, &common_);
    if (!factor_ || !cholmod_factorize(&a, factor_, &common_) || common_.status != CHOLMOD_OK)
      throw std::runtime_error("CHOLMOD could not factorise the matrix");
  }

  void inverse_block(const Eigen::SparseMatrix<double>& loads, std::size_t block,
                     std::span<float> out) override {
    const std::size_t n = static_cast<std::size_t>(lower_.rows()), s = static_cast<std::size_t>(loads.cols());
    cholmod_dense* x = nullptr;
    cholmod_dense *y = nullptr, *e = nullptr;
    for (std::size_t first = 0; first < s; first += block) {
      const std::size_t columns = std::min(block, s - first);
      cholmod_dense* b = cholmod_zeros(n, columns, CHOLMOD_REAL, &common_);
      for (std::size_t j = 0; j < columns; ++j)
        for (Eigen::SparseMatrix<double>::InnerIterator it(loads, static_cast<Eigen::Index>(first + j)); it;
             ++it)
          static_cast<double*>(b->x)[j * n + static_cast<std::size_t>(it.row())] = it.value();
      if (x && x->ncol != columns) cholmod_free_dense(&x, &common_);
      if (!cholmod_solve2(CHOLMOD_A, factor_, b, nullptr, &x, nullptr, &y, &e, &common_))
        throw std::runtime_error("CHOLMOD could not solve");
      for (std::size_t j = 0; j < columns; ++j)
        for (std::size_t i = 0; i < s; ++i) {
          double sum = 0;
          for (Eigen::SparseMatrix<double>::InnerIterator it(loads, static_cast<Eigen::Index>(i)); it; ++it)
            sum += it.value() * static_cast<const double*>(x->x)[j * n + static_cast<std::size_t>(it.row())];
          out[(first + j) * s + i] = static_cast<float>(sum);
        }
      cholmod_free_dense(&b, &common_);
    }
    cholmod_free_dense(&x, &common_);
    cholmod_free_dense(&y, &common_);
    cholmod_free_dense(&e, &common_);
  }

 private:
  cholmod_sparse view() {
    cholmod_sparse a{};
    a.nrow = a.ncol = static_cast<std::size_t>(lower_.rows());
    a.nzmax = static_cast<std::size_t>(lower_.nonZeros());
    a.p = lower_.outerIndexPtr();
    a.i = lower_.innerIndexPtr();
    a.x = lower_.valuePtr();
    a.stype = -1;
    a.itype = CHOLMOD_INT;
    a.xtype = CHOLMOD_REAL;
    a.dtype = CHOLMOD_DOUBLE;
    a.sorted = a.packed = 1;
    return a;
  }
  Eigen::SparseMatrix<double> lower_;
  cholmod_common common_{};
  cholmod_factor* factor_ = nullptr;
};

}  // namespace

std::unique_ptr<Factorisation> make_cholmod(const Eigen::SparseMatrix<double>& matrix) {
  return std::make_unique<Cholmod>(matrix);
}

}  // namespace palpate::peers
