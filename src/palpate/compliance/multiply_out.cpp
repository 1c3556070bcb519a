// C = Y^T Y as few large products: two loads share the part of their paths above the front where these meet,
// so that a pair of subtrees is one product over the whole common path.
#include <algorithm>
#include <cstring>
#include <numeric>

#include "palpate/base/parallel_for.hpp"
#include "palpate/compliance/cholesky_impl.hpp"
#include "palpate/compliance/dense.hpp"
#include "palpate/compliance/factored.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

constexpr std::size_t small_subtree = 384;  // ranks up to which a subtree's square stays in cache

template <class Scalar>
void transpose(const Scalar* from, std::size_t leading, std::size_t rows, std::size_t columns, Scalar* to) {
  for (std::size_t c = 0; c < columns; ++c)
    for (std::size_t r = 0; r < rows; ++r) to[c * leading + r] = from[r * leading + c];
}

typedef float Four [[gnu::vector_size(16)]];

Four load(const float* p) {
  Four v;
  std::memcpy(&v, p, sizeof v);
  return v;
}

// By blocks of 4 x 4 in registers.
void transpose(const float* from, std::size_t leading, std::size_t rows, std::size_t columns, float* to) {
  const std::size_t r4 = rows & ~std::size_t{3}, c4 = columns & ~std::size_t{3};
  for (std::size_t c = 0; c < c4; c += 4)
    for (std::size_t r = 0; r < r4; r += 4) {
      const float* p = from + r * leading + c;
      const Four a = load(p), b = load(p + leading), d = load(p + 2 * leading), e = load(p + 3 * leading);
      const Four ab = __builtin_shufflevector(a, b, 0, 4, 1, 5),
                 de = __builtin_shufflevector(d, e, 0, 4, 1, 5);
      const Four ab2 = __builtin_shufflevector(a, b, 2, 6, 3, 7),
                 de2 = __builtin_shufflevector(d, e, 2, 6, 3, 7);
      const Four columns_out[4] = {
          __builtin_shufflevector(ab, de, 0, 1, 4, 5), __builtin_shufflevector(ab, de, 2, 3, 6, 7),
          __builtin_shufflevector(ab2, de2, 0, 1, 4, 5), __builtin_shufflevector(ab2, de2, 2, 3, 6, 7)};
      for (std::size_t k = 0; k < 4; ++k)
        std::memcpy(to + (c + k) * leading + r, &columns_out[k], sizeof(Four));
    }
  transpose<float>(from + r4 * leading, leading, rows - r4, columns, to + r4);
  transpose<float>(from + c4, leading, r4, columns - c4, to + c4 * leading);
}

// Rows begin .. end - 1 of C by columns left .. right - 1 at or below the diagonal.
struct Task {
  std::size_t begin, end, left, right;
  std::size_t path;   // common part of the paths
  Index branch = -1;  // a whole small subtree, to be followed downwards
  double flops() const {
    return static_cast<double>(end - begin) * static_cast<double>(right - left) *
           static_cast<double>(path + 100);
  }
};

template <class Scalar>
struct Product {
  const Factored<Scalar>& y;
  Scalar* out;
  std::size_t n;
  std::vector<Task> tasks;
  std::vector<Index> first;  // first branch of each branch's subtree

  static constexpr std::size_t tile = Factored<Scalar>::panel_rows;
  static std::size_t tile_end(std::size_t rank, std::size_t end) {
    return std::min(end, (rank / tile + 1) * tile);
  }

  void add_rectangle(std::size_t begin, std::size_t end, std::size_t left, std::size_t right,
                     std::size_t path) {
    for (std::size_t i = begin; i < end; i = tile_end(i, end))
      for (std::size_t j = left; j < right; j = tile_end(j, right))
        tasks.push_back({i, tile_end(i, end), j, tile_end(j, right), path});
  }
  void add_triangle(std::size_t begin, std::size_t end, std::size_t path) {
    for (std::size_t i = begin; i < end; i = tile_end(i, end)) {
      tasks.push_back({i, tile_end(i, end), i, tile_end(i, end), path});
      add_rectangle(i, tile_end(i, end), begin, i, path);
    }
  }

  // All pairs of loads in the subtrees of `children` and the own loads own .. end - 1.
  void plan(std::span<const Index> children, std::size_t begin, std::size_t own, std::size_t end,
            std::size_t path) {
    for (const Index c : children) {
      const auto& child = y.branches[at(c)];
      add_rectangle(child.begin, child.end, begin, child.begin, path);
      if (child.end - child.begin <= small_subtree && child.begin / tile == (child.end - 1) / tile)
        tasks.push_back({child.begin, child.end, child.begin, child.end, child.path(), c});
      else
        plan(y.children_of(at(c)), child.begin, child.own, child.end, child.path());
    }
    add_rectangle(own, end, begin, own, path);
    add_triangle(own, end, path);
  }

  void plan() {
    std::vector<Index> roots;
    first.resize(y.branches.size());
    for (std::size_t b = 0; b < first.size(); ++b) {
      first[b] = y.children_of(b).empty() ? static_cast<Index>(b) : first[at(y.children_of(b).front())];
      if (y.branches[b].parent < 0) roots.push_back(static_cast<Index>(b));
    }
    plan(roots, 0, n, n, 0);
    std::stable_sort(tasks.begin(), tasks.end(),
                     [](const Task& a, const Task& b) { return a.flops() > b.flops(); });
  }

  const Scalar* row(std::size_t rank, std::size_t k) const { return y.y.data() + y.index(rank, k); }

  // Row-major lower is column-major upper. Path positions from .. to - 1 of ranks begin .. end - 1.
  void square(std::size_t begin, std::size_t end, std::size_t from, std::size_t to, Scalar beta) const {
    for (std::size_t k = from; k < to; k += part_of_sum, beta = 1)
      dense::square(false, end - begin, std::min(part_of_sum, to - k), Scalar(1), row(begin, k),
                    y.leading(begin), beta, out + begin * n + begin, n);
  }
  void rectangle(const Task& t) const {
    for (std::size_t k = 0; k < t.path; k += part_of_sum)
      dense::multiply(t.right - t.left, t.end - t.begin, std::min(part_of_sum, t.path - k), Scalar(1),
                      row(t.left, k), y.leading(t.left), row(t.begin, k), y.leading(t.begin), Scalar(k > 0),
                      out + t.begin * n + t.left, n);
  }

  void run(const Task& t) const {
    if (t.path == 0) {  // different bodies do not feel each other
      for (std::size_t i = t.begin; i < t.end; ++i)
        std::fill(out + i * n + t.left, out + i * n + t.right, Scalar(0));
    } else if (t.begin == t.left) {
      square(t.begin, t.end, 0, t.path, 0);
    } else {
      rectangle(t);
    }
    if (t.branch >= 0)
      for (Index b = first[at(t.branch)]; b < t.branch; ++b) {
        const auto& branch = y.branches[at(b)];
        square(branch.begin, branch.end, branch.depth, branch.path(), 1);
      }
    mirror(t);
  }

  // The other triangle, while the tile is still in cache.
  void mirror(const Task& t) const {
    constexpr std::size_t step = 64;
    for (std::size_t i = t.begin; i < t.end; i += step)
      for (std::size_t j = t.left; j < t.right; j += step) {
        const std::size_t ie = std::min(t.end, i + step), je = std::min(t.right, j + step);
        if (je <= i)
          transpose(out + i * n + j, n, ie - i, je - j, out + j * n + i);
        else
          for (std::size_t c = j; c < je; ++c)
            for (std::size_t r = std::max(i, c + 1); r < ie; ++r) out[c * n + r] = out[r * n + c];
      }
  }
};

// Rows and columns from the order of the elimination into that of the loads, in place: row t <- row from[t]
// in triples, along the cycles of the permutation. The cycles are cut, so that threads can share them.
template <class Scalar>
class Permutation {
 public:
  Permutation(Scalar* matrix, const std::vector<Index>& load_at)
      : matrix_(matrix), n_(3 * load_at.size()), from_(load_at.size()) {
    for (std::size_t r = 0; r < load_at.size(); ++r) from_[at(load_at[r])] = static_cast<Index>(r);
  }
  void run(int threads) {
    moves_ = list_moves();
    // Rows that another piece overwrites before they are needed here: two for each piece.
    const std::size_t pieces = (moves_.size() + piece - 1) / piece, size = 3 * n_;
    std::vector<Scalar> saved(pieces * 2 * size);
    parallel_for(pieces, 1, threads, [&](std::size_t p, std::size_t) {
      Scalar* to = saved.data() + p * 2 * size;
      std::copy_n(row(source(chain_end(p))), size, to);
      std::copy_n(row(source(piece_end(p) - 1)), size, to + size);
    });
    parallel_for(pieces, 1, threads,
                 [&](std::size_t p, std::size_t) { move(p, saved.data() + p * 2 * size); });
  }

 private:
  static constexpr std::size_t piece = 64;
  Scalar* row(std::size_t t) const { return matrix_ + 3 * t * n_; }

  // Every row once; after a row the one that it comes from, as long as its cycle lasts.
  std::vector<std::size_t> list_moves() const {
    std::vector<std::size_t> moves;
    std::vector<std::uint8_t> done(from_.size(), 0);
    for (std::size_t start = 0; start < from_.size(); ++start)
      for (std::size_t t = start; !done[t]; t = at(from_[t])) {
        done[t] = 1;
        moves.push_back(t);
      }
    return moves;
  }

  std::size_t source(std::size_t i) const { return at(from_[moves_[i]]); }
  std::size_t piece_end(std::size_t p) const { return std::min(moves_.size(), (p + 1) * piece); }
  // The last move of the piece's first chain: its source may be in another piece.
  std::size_t chain_end(std::size_t p) const {
    std::size_t i = p * piece;
    while (i + 1 < piece_end(p) && source(i) == moves_[i + 1]) ++i;
    return i;
  }

  void move(std::size_t p, const Scalar* saved) const {
    std::vector<Scalar> copy(n_ + 1), start(3 * n_);  // old row of the first member of the cycle at hand
    const std::size_t chain = chain_end(p), end = piece_end(p);
    for (std::size_t i = p * piece; i < end; ++i) {
      const Scalar* from = row(source(i));
      if (i == chain)
        from = saved;
      else if (i + 1 == end)
        from = saved + 3 * n_;
      else if (source(i) != moves_[i + 1])
        from = start.data();
      if (i > chain && source(i - 1) != moves_[i]) std::copy_n(row(moves_[i]), 3 * n_, start.data());
      for (std::size_t a = 0; a < 3; ++a) gather(from + a * n_, row(moves_[i]) + a * n_, copy.data());
    }
  }

  // By way of a copy, which streams. Four numbers are moved for three, the fourth to be overwritten by the
  // next.
  void gather(const Scalar* from, Scalar* to, Scalar* copy) const {
    std::copy_n(from, n_, copy);
    for (std::size_t c = 0; c + 1 < from_.size(); ++c)
      std::memcpy(to + 3 * c, copy + 3 * at(from_[c]), 4 * sizeof(Scalar));
    std::copy_n(copy + 3 * at(from_.back()), 3, to + n_ - 3);
  }

  Scalar* matrix_;
  std::size_t n_;
  std::vector<Index> from_;
  std::vector<std::size_t> moves_;
};

}  // namespace

template <class Scalar>
void multiply_out(const Factored<Scalar>& factored, std::span<Scalar> out, int threads,
                  const Progress& progress) {
  const std::size_t n = factored.size();
  if (out.size() != n * n)
    throw Error(ErrorKind::internal, "compliance of {}^2 into {} numbers", n, out.size());
  Product<Scalar> product{factored, out.data(), n, {}, {}};
  product.plan();
  double total = 0;
  for (const Task& t : product.tasks) total += t.flops();
  SharedProgress shared(progress, total);
  parallel_for(product.tasks.size(), 1, threads, [&](std::size_t i, std::size_t) {
    product.run(product.tasks[i]);
    shared.add(product.tasks[i].flops());
  });
  Permutation<Scalar>(out.data(), factored.load_at).run(threads);
}

template void multiply_out(const Factored<float>&, std::span<float>, int, const Progress&);
template void multiply_out(const Factored<double>&, std::span<double>, int, const Progress&);

}  // namespace palpate
