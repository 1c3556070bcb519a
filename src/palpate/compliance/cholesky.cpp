#include <algorithm>
#include <cmath>

#include "palpate/base/parallel_for.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/compliance/cholesky_impl.hpp"
#include "palpate/compliance/dense.hpp"
#include "palpate/compliance/multifrontal.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// A pivot this small against its diagonal entry is rounding noise: the body can still move freely.
constexpr double smallest_pivot = 1e-13;
constexpr std::size_t tile = 512;      // of large fronts, rows and columns
constexpr double large_front = 3e8;    // flops from which on a front is tiled
constexpr double smallest_task = 1e7;  // flops below which a subtree is not split further

double flops(const Front& f) {
  const auto w = static_cast<double>(f.width()), b = static_cast<double>(f.below_rows());
  return w * w * w / 3 + w * w * b + w * b * b;
}

struct Factorisation {
  using Stack = TreeStack<double>;
  struct Worker {
    Worker(std::size_t nodes, std::size_t stack_size) : place(nodes), stack(stack_size) {}
    std::vector<Index> place;      // of a position in the front at hand, nodes
    std::vector<double> diagonal;  // of the matrix, for the pivots at hand
    Stack stack;
  };

  const Eigen::SparseMatrix<double>& matrix;
  Cholesky::Impl& impl;
  int threads;
  SharedProgress progress;
  std::vector<std::uint8_t> odd;                // depth of each front in the tree
  std::vector<Index> first_of;                  // first front of each front's subtree
  std::vector<std::uint8_t> is_task;            // roots of the subtrees that are tasks of their own
  std::vector<double*> update;                  // update matrix of each front, while it is needed
  std::vector<std::unique_ptr<double[]>> kept;  // memory of those that tasks hand over

  Factorisation(const Eigen::SparseMatrix<double>& a, Cholesky::Impl& i, int threads_, const Progress& p)
      : matrix(a),
        impl(i),
        threads(threads_ > 0 ? threads_ : default_threads()),
        progress(p, i.stats.factor_flops) {
    const auto& fronts = impl.symbolic.fronts;
    odd.assign(fronts.size(), 0), is_task = odd;
    update.assign(fronts.size(), nullptr);
    kept.resize(fronts.size());
    first_of.resize(fronts.size());
    for (std::size_t s = fronts.size(); s-- > 0;)
      if (fronts[s].parent >= 0) odd[s] = !odd[at(fronts[s].parent)];
    for (std::size_t s = 0; s < fronts.size(); ++s) {
      const auto children = impl.symbolic.children_of(s);
      first_of[s] = children.empty() ? static_cast<Index>(s) : first_of[at(children.front())];
    }
  }

  const Front& front(std::size_t s) const { return impl.symbolic.fronts[s]; }

  // The most memory that update matrices take in a walk over fronts begin .. end - 1 but `skip`.
  std::size_t stack_need(std::size_t begin, std::size_t end, const std::vector<std::uint8_t>& skip) const {
    StackNeed need;
    for (std::size_t s = begin; s < end; ++s) {
      if (skip[s]) continue;
      need.push(front(s).below_rows() * front(s).below_rows());
      for (const Index c : impl.symbolic.children_of(s))
        if (!skip[at(c)]) need.pop(front(at(c)).below_rows() * front(at(c)).below_rows());
    }
    return need.most();
  }

  // Roots of disjoint subtrees, the most work first: the largest are split until there are enough.
  std::vector<Index> choose_tasks() const {
    const auto& fronts = impl.symbolic.fronts;
    std::vector<double> work(fronts.size(), 0);
    std::vector<Index> roots;
    for (std::size_t s = 0; s < fronts.size(); ++s) {
      work[s] += flops(fronts[s]);
      if (fronts[s].parent >= 0)
        work[at(fronts[s].parent)] += work[s];
      else
        roots.push_back(static_cast<Index>(s));
    }
    const auto less = [&](Index a, Index b) { return work[at(a)] < work[at(b)]; };
    std::make_heap(roots.begin(), roots.end(), less);
    const std::size_t enough = threads > 1 ? 8 * at(threads) : 0;
    while (!roots.empty() && roots.size() < enough && work[at(roots.front())] > smallest_task) {
      std::pop_heap(roots.begin(), roots.end(), less);
      const Index top = roots.back();
      roots.pop_back();
      for (const Index c : impl.symbolic.children_of(at(top))) {
        roots.push_back(c);
        std::push_heap(roots.begin(), roots.end(), less);
      }
    }
    std::sort(roots.begin(), roots.end(),
              [&](Index a, Index b) { return std::pair(-work[at(a)], a) < std::pair(-work[at(b)], b); });
    return roots;
  }

  // Entries of the matrix into the front's panel, lower triangle.
  void assemble_matrix(const Front& f, double* panel, Worker& w) const {
    const Symbolic& sym = impl.symbolic;
    for (Index i = 0; i < f.pivots; ++i) w.place[at(f.first + i)] = i;
    const auto rows = sym.rows_of(f);
    for (std::size_t i = 0; i < rows.size(); ++i) w.place[at(rows[i])] = f.pivots + static_cast<Index>(i);
    w.diagonal.assign(f.width(), 0);
    for (std::size_t col = 0; col < f.width(); ++col) {
      const Index pivot = f.first + static_cast<Index>(col / 3);
      double* column = panel + col * f.height();
      const Index source = 3 * sym.node_at[at(pivot)] + static_cast<Index>(col % 3);
      for (Eigen::SparseMatrix<double>::InnerIterator it(matrix, source); it; ++it) {
        const auto row = static_cast<Index>(it.row());
        const Index position = sym.position_of[at(row / 3)];
        if (position >= pivot) column[3 * at(w.place[at(position)]) + at(row % 3)] = it.value();
        if (row == source) w.diagonal[col] = it.value();
      }
    }
  }

  // Adds columns [begin, end) (nodes) of a child's update matrix to a block of the parent that
  // starts at its row and column `first`.
  void extend_add(const Front& child, const double* from, std::size_t begin, std::size_t end, double* to,
                  std::size_t leading, std::size_t first) const {
    const auto place = impl.symbolic.place_of(child);
    const std::size_t n = child.below_rows();
    for (std::size_t j = begin; j < end; ++j) {
      const double* source = from + 3 * j * n;
      double* target = to + (3 * at(place[j]) - first) * leading;
      for (std::size_t i = j; i < place.size();) {  // runs of consecutive places
        std::size_t last = i + 1;
        while (last < place.size() && place[last] == place[last - 1] + 1) ++last;
        const std::size_t shift = 3 * at(place[i]) - first, length = 3 * (last - i);
        for (std::size_t a = 0; a < 3; ++a)
          for (std::size_t k = 0; k < length; ++k)
            target[a * leading + shift + k] += source[a * n + 3 * i + k];
        i = last;
      }
    }
  }

  void eliminate(std::size_t s, double* panel, const Worker& w) const {
    const Front& f = front(s);
    const std::size_t n = f.width(), m = f.height(), b = f.below_rows();
    const int bad = dense::cholesky(n, panel, m);
    for (std::size_t k = 0; k < (bad ? at(bad) - 1 : n); ++k)
      if (!(panel[k * m + k] * panel[k * m + k] > smallest_pivot * w.diagonal[k])) fail_at(f, k);
    if (bad) fail_at(f, at(bad) - 1);
    double* inverse = impl.inverse.data() + dense::inverse_block * 3 * at(f.first);
    dense::invert_blocks(n, panel, m, inverse);
    if (b == 0) return;
    const std::size_t step = flops(f) > large_front ? tile : b;
    parallel_for(b, step, threads, [&](std::size_t begin, std::size_t end) {
      std::vector<double> work((end - begin) * dense::inverse_block);
      dense::solve_right(end - begin, n, panel, m, inverse, panel + n + begin, m, work.data());
    });
  }

  [[noreturn]] void fail_at(const Front& f, std::size_t column) const {
    throw NotPositiveDefinite(impl.symbolic.node_at[at(f.first) + column / 3]);
  }

  // update = - (panel below) (panel below)^T, lower triangle.
  void make_update(const Front& f, const double* panel, double* to) const {
    const std::size_t n = f.width(), m = f.height(), b = f.below_rows();
    const double* below = panel + n;
    if (flops(f) <= large_front) return dense::square(true, b, n, -1.0, below, m, 0.0, to, b);
    parallel_for(b, tile, threads, [&](std::size_t begin, std::size_t end) {
      dense::square(true, end - begin, n, -1.0, below + begin, m, 0.0, to + begin * b + begin, b);
      if (end < b)
        dense::multiply(b - end, end - begin, n, -1.0, below + end, m, below + begin, m, 0.0,
                        to + begin * b + end, b);
    });
  }

  void process(std::size_t s, Worker& w) {
    const Front& f = front(s);
    const std::size_t n = f.width(), m = f.height(), b = f.below_rows();
    double* panel = impl.l.data() + f.panel;
    assemble_matrix(f, panel, w);
    const auto children = impl.symbolic.children_of(s);
    std::vector<std::size_t> split(children.size());  // where a child's columns leave our pivots
    for (std::size_t c = 0; c < children.size(); ++c) {
      const Front& child = front(at(children[c]));
      const auto place = impl.symbolic.place_of(child);
      split[c] =
          static_cast<std::size_t>(std::lower_bound(place.begin(), place.end(), f.pivots) - place.begin());
      extend_add(child, update[at(children[c])], 0, split[c], panel, m, 0);
    }
    eliminate(s, panel, w);

    double* own = w.stack.push(odd[s], b * b);
    if (b > 0) make_update(f, panel, own);
    for (std::size_t c = 0; c < children.size(); ++c) {
      const Front& child = front(at(children[c]));
      extend_add(child, update[at(children[c])], split[c], at(child.below), own, b, n);
    }
    for (std::size_t c = children.size(); c-- > 0;) {
      const std::size_t child = at(children[c]), size = front(child).below_rows() * front(child).below_rows();
      if (is_task[child])
        kept[child].reset();
      else
        w.stack.pop(odd[child], size);
    }
    update[s] = own;
    progress.add(flops(f));
  }

  void run() {
    const auto& fronts = impl.symbolic.fronts;
    const std::vector<Index> tasks = choose_tasks();
    std::vector<std::uint8_t> in_task(fronts.size(), 0);
    std::size_t need = 0;
    for (const Index root : tasks)
      need = std::max(need, stack_need(at(first_of[at(root)]), at(root) + 1, in_task));
    for (const Index root : tasks) {
      is_task[at(root)] = 1;
      std::fill(in_task.begin() + first_of[at(root)], in_task.begin() + root + 1, 1);
    }
    const std::size_t above = stack_need(0, fronts.size(), in_task);
    const std::size_t inverses = dense::inverse_block * 3 * impl.symbolic.node_at.size();
    const std::size_t bytes = sizeof(double) * (inverses + impl.symbolic.panel_entries + above + 2 * need);
    if (bytes > available_bytes())
      throw Error(ErrorKind::resource,
                  "factorising this stiffness needs {:.1f} GB, {:.1f} GB are free; use a "
                  "coarser mesh",
                  static_cast<double>(bytes) * 1e-9, static_cast<double>(available_bytes()) * 1e-9);
    impl.l = HugeArray<double>(impl.symbolic.panel_entries);
    impl.inverse = HugeArray<double>(inverses);

    {
      Pool<Worker> workers;
      parallel_for(tasks.size(), 1, threads, [&](std::size_t begin, std::size_t) {
        auto worker =
            workers.take([&] { return std::make_unique<Worker>(impl.symbolic.node_at.size(), need); });
        run_task(at(tasks[begin]), *worker);
        workers.give(std::move(worker));
      });
    }
    Worker worker(impl.symbolic.node_at.size(), above);
    for (std::size_t s = 0; s < fronts.size(); ++s)
      if (!in_task[s]) process(s, worker);
  }

  void run_task(std::size_t root, Worker& worker) {
    for (std::size_t s = at(first_of[root]); s <= root; ++s) process(s, worker);
    const std::size_t size = front(root).below_rows() * front(root).below_rows();
    kept[root].reset(new double[size]);
    std::copy_n(update[root], size, kept[root].get());
    worker.stack.pop(odd[root], size);
    update[root] = kept[root].get();
  }
};

}  // namespace

Cholesky::Cholesky(const Eigen::SparseMatrix<double>& matrix, const std::vector<Index>& order, int threads,
                   const Progress& progress)
    : Cholesky(matrix, analyse(node_graph(matrix), order), threads, progress) {}

Cholesky::Cholesky(const Eigen::SparseMatrix<double>& matrix, Symbolic symbolic, int threads,
                   const Progress& progress)
    : impl_(std::make_unique<Impl>()) {
  impl_->symbolic = std::move(symbolic);
  impl_->stats.supernodes = impl_->symbolic.fronts.size();
  for (const Front& f : impl_->symbolic.fronts) {
    impl_->stats.factor_entries += f.height() * f.width() - f.width() * (f.width() - 1) / 2;
    impl_->stats.factor_flops += flops(f);
  }
  Factorisation(matrix, *impl_, threads, progress).run();
}

Cholesky::~Cholesky() = default;
Cholesky::Cholesky(Cholesky&&) noexcept = default;
Cholesky& Cholesky::operator=(Cholesky&&) noexcept = default;

const SymbolicStats& Cholesky::stats() const { return impl_->stats; }

void Cholesky::solve(std::span<double> b, std::size_t columns) const {
  const Symbolic& sym = impl_->symbolic;
  const std::size_t n = 3 * sym.node_at.size();
  if (b.size() != n * columns)
    throw Error(ErrorKind::internal, "solve: {} numbers for {} columns of {}", b.size(), columns, n);
  // Column by column in the order of the elimination, transposed: the values of one unknown lie together.
  std::vector<double> x(n * columns), part;
  const auto source = [&](std::size_t k) { return 3 * at(sym.node_at[k / 3]) + k % 3; };
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t c = 0; c < columns; ++c) x[k * columns + c] = b[c * n + source(k)];
  for (const Front& f : sym.fronts) {
    double* y = x.data() + 3 * at(f.first) * columns;
    const double* panel = impl_->l.data() + f.panel;
    part.resize(std::max(f.below_rows(), dense::inverse_block) * columns);
    dense::solve_right(columns, f.width(), panel, f.height(), impl_->inverse_of(f), y, columns, part.data());
    part.resize(f.below_rows() * columns);
    if (part.empty()) continue;
    dense::multiply(columns, f.below_rows(), f.width(), 1.0, y, columns, panel + f.width(), f.height(), 0.0,
                    part.data(), columns);
    for (std::size_t i = 0; i < part.size(); ++i)
      x[(3 * at(sym.rows_of(f)[i / (3 * columns)])) * columns + i % (3 * columns)] -= part[i];
  }
  for (std::size_t s = sym.fronts.size(); s-- > 0;) {
    const Front& f = sym.fronts[s];
    double* y = x.data() + 3 * at(f.first) * columns;
    const double* panel = impl_->l.data() + f.panel;
    part.resize(f.below_rows() * columns);
    for (std::size_t i = 0; i < part.size(); ++i)
      part[i] = x[(3 * at(sym.rows_of(f)[i / (3 * columns)])) * columns + i % (3 * columns)];
    dense::solve_back(columns, f.width(), f.below_rows(), panel, f.height(), part.data(), y);
  }
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t c = 0; c < columns; ++c) b[c * n + source(k)] = x[k * columns + c];
}

}  // namespace palpate
