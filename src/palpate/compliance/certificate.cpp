// The certificate of the hierarchical form. Halko, Martinsson, Tropp (2011), eq. 4.3.
#include <cmath>

#include "palpate/compliance/hierarchical.hpp"
#include "palpate/compliance/sketches.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// |E| <= bound sqrt(2 / pi) max |E w| over `probes` Gaussian w, but with probability bound^-probes = 1e-9.
// Nine probes would have a bound of ten: five times the storage's accuracy for nothing.
constexpr std::size_t probes = certificate_probes;
constexpr double bound = 2;
constexpr unsigned seed = 1000003;  // not those that the bases were found with

// c = a b + beta c, or a^T b; column-major; b has k rows.
void gemm(bool transposed, std::size_t m, std::size_t n, std::size_t k, const float* a, const float* b,
          float beta, float* c) {
  if (m == 0 || n == 0) return;
  const int ldb = dense::blas(std::max<std::size_t>(k, 1));
  cblas_sgemm(CblasColMajor, transposed ? CblasTrans : CblasNoTrans, CblasNoTrans, dense::blas(m),
              dense::blas(n), dense::blas(k), 1, a, transposed ? ldb : dense::blas(m), b, ldb, beta, c,
              dense::blas(m));
}

class Certificate {
 public:
  Certificate(const Hierarchical& h, const Factored<float>& y, int threads, const Progress& progress)
      : h_(h), sketches_(y, h, threads), progress_(progress) {}

  std::vector<double> run() {
    SharedProgress done(progress_, 3.0 * static_cast<double>(std::size_t{1} << h_.levels));
    sketches_.make(seed, probes, h_.levels, done);
    carry_up();
    std::vector<std::vector<Part>> parts(h_.clusters());
    sketches_.each(h_.levels, [&](std::size_t leaf) {
      parts[leaf] = check(leaf);
      done.add(2);
    });
    std::vector<Squares> sum(h_.blocks.size(), Squares{});
    for (const auto& list : parts)
      for (const Part& part : list)
        for (std::size_t p = 0; p < probes; ++p) sum[part.block][p] += part.squares[p];
    std::vector<double> out(sum.size());
    for (std::size_t b = 0; b < out.size(); ++b)
      out[b] =
          bound * std::sqrt(2 / M_PI * *std::max_element(sum[b].begin(), sum[b].end()) /
                            (sketches_.norm(at(h_.blocks[b].row)) * sketches_.norm(at(h_.blocks[b].column))));
    return out;
  }

 private:
  using Squares = std::array<double, probes>;  // of |E w|, of each probe
  struct Part {
    std::size_t block;
    Squares squares;
  };

  const float* values(std::size_t offset) const { return h_.values.data() + offset; }

  // The probes in the bases: x = basis^T w. And where the blocks of each row begin.
  void carry_up() {
    probe_.resize(h_.clusters()), x_.resize(h_.clusters()), first_.assign(h_.clusters() + 1, 0);
    for (std::size_t c = h_.clusters(); c-- > 0;) {
      x_[c].assign(h_.width(c) * probes, 0.0f);
      if (h_.leaf(c)) {
        probe_[c] = gaussian(seed, c, h_.unknowns(c) * probes);
        gemm(true, h_.width(c), probes, h_.unknowns(c), values(h_.basis[c]), probe_[c].data(), 0,
             x_[c].data());
      } else {
        for (const std::size_t child : {2 * c + 1, 2 * c + 2})
          gemm(true, h_.width(c), probes, h_.width(child), values(h_.transfer[child]), x_[child].data(), 1,
               x_[c].data());
      }
    }
    for (const auto& b : h_.blocks) ++first_[at(b.row) + 1];
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
  }

  // A leaf's part of every block that it, or a cluster above it, is the row of.
  std::vector<Part> check(std::size_t leaf) const {
    const std::size_t m = h_.unknowns(leaf);
    const PathMatrix own = sketches_.columns(leaf);
    std::vector<float> base(values(h_.basis[leaf]), values(h_.basis[leaf]) + m * h_.width(leaf));
    std::vector<float> exact(m * probes), stored(m * probes), y;
    std::vector<Part> parts;
    for (std::size_t c = leaf;; c = (c - 1) / 2) {
      for (std::size_t b = first_[c]; b < first_[c + 1]; ++b) {
        const std::size_t other = at(h_.blocks[b].column);
        const float* block = values(h_.blocks[b].values);
        multiply_paths(own, sketches_.of(other), probes, exact.data(), m);
        if (h_.blocks[b].near) {
          gemm(false, m, probes, h_.unknowns(other), block, probe_[other].data(), 0, stored.data());
        } else {
          y.resize(h_.width(c) * probes);
          std::fill(stored.begin(), stored.end(), 0.0f);
          gemm(false, h_.width(c), probes, h_.width(other), block, x_[other].data(), 0, y.data());
          if (h_.width(c) > 0) gemm(false, m, probes, h_.width(c), base.data(), y.data(), 0, stored.data());
        }
        Part part{b, {}};
        for (std::size_t i = 0; i < m * probes; ++i) {
          const double e = static_cast<double>(exact[i]) - static_cast<double>(stored[i]);
          part.squares[i / m] += e * e;
        }
        parts.push_back(part);
      }
      if (c == 0) return parts;
      const std::size_t n = h_.width((c - 1) / 2);
      std::vector<float> next(m * n, 0.0f);
      if (h_.width(c) > 0)
        gemm(false, m, n, h_.width(c), base.data(), values(h_.transfer[c]), 0, next.data());
      base = std::move(next);
    }
  }

  const Hierarchical& h_;
  Sketches sketches_;
  const Progress& progress_;
  std::vector<std::vector<float>> probe_, x_;  // of each leaf; of each cluster
  std::vector<std::size_t> first_;             // block of each row
};

}  // namespace

std::vector<double> block_errors(const Hierarchical& h, const Factored<float>& factored, int threads,
                                 const Progress& progress) {
  return Certificate(h, factored, threads, progress).run();
}

}  // namespace palpate
