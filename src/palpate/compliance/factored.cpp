#include "palpate/compliance/factored.hpp"

#include <algorithm>
#include <cstring>
#include <numeric>

#include "palpate/base/parallel_for.hpp"
#include "palpate/compliance/cholesky_impl.hpp"
#include "palpate/compliance/dense.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

constexpr std::size_t group_rows = 480;  // ranks taken through the tree together: their blocks stay in L2

// The loads along the elimination.
struct Loads {
  struct Entry {
    std::size_t rank, unknown;  // unknown: 0, 1, 2 of its node
    double value;
  };
  std::vector<Index> order;        // load of each triple of ranks
  std::vector<Index> front;        // the first front that each triple of ranks is in
  std::vector<std::size_t> begin;  // of each position's entries
  std::vector<Entry> entries;      // by position, then rank
};

std::vector<Index> front_of_positions(const Symbolic& sym) {
  std::vector<Index> front(sym.node_at.size());
  for (std::size_t s = 0; s < sym.fronts.size(); ++s)
    std::fill_n(front.begin() + sym.fronts[s].first, sym.fronts[s].pivots, static_cast<Index>(s));
  return front;
}

// The first front of each front's subtree: s is in the subtree of t where first[t] <= s <= t.
std::vector<Index> first_fronts(const Symbolic& sym) {
  std::vector<Index> first(sym.fronts.size());
  for (std::size_t s = 0; s < first.size(); ++s)
    first[s] = sym.children_of(s).empty() ? static_cast<Index>(s) : first[at(sym.children_of(s).front())];
  return first;
}

using Sparse = Eigen::SparseMatrix<double>;

template <class Body>
void for_each_entry(const Sparse& loads, std::size_t load, Body body) {
  for (std::size_t a = 0; a < 3; ++a)
    for (Sparse::InnerIterator it(loads, static_cast<Index>(3 * load + a)); it; ++it)
      body(at(static_cast<Index>(it.row())), a, it.value());
}

Loads sort_loads(const Symbolic& sym, const Sparse& loads) {
  const std::size_t nodes = sym.node_at.size(), count = static_cast<std::size_t>(loads.cols()) / 3;
  if (static_cast<std::size_t>(loads.rows()) != 3 * nodes || loads.cols() % 3 != 0)
    throw Error(ErrorKind::internal, "loads of {} x {} for {} nodes", loads.rows(), loads.cols(), nodes);
  std::vector<Index> lowest(count, static_cast<Index>(nodes));
  Loads out;
  out.begin.assign(nodes + 1, 0);
  for (std::size_t j = 0; j < count; ++j) {
    for_each_entry(loads, j, [&](std::size_t row, std::size_t, double) {
      lowest[j] = std::min(lowest[j], sym.position_of[row / 3]);
      ++out.begin[at(sym.position_of[row / 3]) + 1];
    });
    if (at(lowest[j]) == nodes) throw Error(ErrorKind::internal, "load {} is on no node", j);
  }
  out.order.resize(count), out.front.resize(count);
  std::iota(out.order.begin(), out.order.end(), 0);
  std::stable_sort(out.order.begin(), out.order.end(),
                   [&](Index a, Index b) { return lowest[at(a)] < lowest[at(b)]; });

  std::partial_sum(out.begin.begin(), out.begin.end(), out.begin.begin());
  out.entries.resize(out.begin.back());
  std::vector<std::size_t> fill(out.begin.begin(), out.begin.end() - 1);
  const std::vector<Index> front = front_of_positions(sym), first = first_fronts(sym);
  for (std::size_t r = 0; r < count; ++r) {
    const Index own = out.front[r] = front[at(lowest[at(out.order[r])])];
    for_each_entry(loads, at(out.order[r]), [&](std::size_t row, std::size_t a, double value) {
      const std::size_t position = at(sym.position_of[row / 3]);
      if (first[at(front[position])] > own)
        throw Error(ErrorKind::internal, "the nodes of load {} are not coupled with each other",
                    out.order[r]);
      out.entries[fill[position]++] = {3 * r + a, row % 3, value};
    });
  }
  return out;
}

template <class Scalar>
void make_branches(const Symbolic& sym, const Loads& loads, Factored<Scalar>& out) {
  const std::vector<Index> first = first_fronts(sym);
  std::vector<Index> branch_of(sym.fronts.size(), -1);
  const auto rank = [&](Index front) {  // of the first load at or after a front
    return 3 * static_cast<std::size_t>(std::lower_bound(loads.front.begin(), loads.front.end(), front) -
                                        loads.front.begin());
  };
  for (std::size_t s = 0; s < sym.fronts.size(); ++s) {
    typename Factored<Scalar>::Branch b;
    b.front = static_cast<Index>(s);
    b.begin = rank(first[s]), b.own = rank(b.front), b.end = rank(b.front + 1);
    b.width = sym.fronts[s].width();
    if (b.begin == b.end) continue;
    branch_of[s] = static_cast<Index>(out.branches.size());
    out.branches.push_back(b);
  }
  for (std::size_t b = out.branches.size(); b-- > 0;) {
    auto& branch = out.branches[b];
    const Index parent = sym.fronts[at(branch.front)].parent;
    if (parent < 0) continue;
    branch.parent = branch_of[at(parent)];
    branch.depth = out.branches[at(branch.parent)].path();
  }
}

// One group of ranks on its way to the root: Y <- L_pivots^-1 (loads + what the children left), and what is
// left for the parent, W <- W - L_below Y, both transposed.
template <class Scalar>
struct Walk {
  const Cholesky::Impl& impl;
  const Symbolic& sym;
  const Loads& loads;
  Factored<Scalar>& out;
  std::vector<std::uint8_t> odd;  // depth of each branch

  struct Worker {
    Worker(std::size_t nodes, std::size_t branches, std::size_t stack_size)
        : source(nodes), w(branches), stack(stack_size) {}
    std::vector<Index> source;  // row of a child that goes to a place of the front at hand, -1: none
    std::vector<double*> w;     // of each branch
    TreeStack<double> stack;
    std::vector<double> y, work;
  };
  struct Range {
    std::size_t begin, end;
    std::size_t size() const { return end > begin ? end - begin : 0; }
  };

  const Front& front(std::size_t b) const { return sym.fronts[at(out.branches[b].front)]; }
  Range part(std::size_t b, Range group) const {
    return {std::max(group.begin, out.branches[b].begin), std::min(group.end, out.branches[b].end)};
  }
  std::size_t left(std::size_t b, Range group) const { return part(b, group).size() * front(b).below_rows(); }

  std::size_t stack_need(Range group) const {
    StackNeed need;
    for (std::size_t b = 0; b < out.branches.size(); ++b) {
      if (part(b, group).size() == 0) continue;
      need.push(left(b, group));
      for (const Index c : out.children_of(b)) need.pop(left(at(c), group));
    }
    return need.most();
  }

  // Copies (or zeros) of the ranks `range` of a child, or of own loads (child -1), into all rows of the
  // front.
  void gather(std::size_t b, Index child, Range range, Range all, double* y, double* w,
              Worker& worker) const {
    if (range.size() == 0) return;
    const Front& f = front(b);
    const std::size_t pivots = at(f.pivots), nodes = pivots + at(f.below), n = range.size();
    const std::size_t shift = range.begin - all.begin;
    std::fill_n(worker.source.begin(), nodes, -1);
    if (child >= 0) {
      const auto place = sym.place_of(front(at(child)));
      for (std::size_t i = 0; i < place.size(); ++i) worker.source[at(place[i])] = static_cast<Index>(i);
    }
    for (std::size_t k = 0; k < nodes; ++k)
      for (std::size_t a = 0; a < 3; ++a) {
        double* to =
            shift + (k < pivots ? y + (3 * k + a) * all.size() : w + (3 * (k - pivots) + a) * all.size());
        const Index i = worker.source[k];
        if (i >= 0)
          std::memcpy(to, worker.w[at(child)] + (3 * at(i) + a) * n, n * sizeof(double));
        else
          std::memset(to, 0, n * sizeof(double));
      }
  }

  void visit(std::size_t b, Range group, Worker& worker) {
    const Range all = part(b, group);
    const auto& branch = out.branches[b];
    const Front& f = front(b);
    const std::size_t k = all.size(), n = f.width(), m = f.height(), rest = f.below_rows();
    worker.y.resize(k * n);
    double* y = worker.y.data();
    double* w = worker.w[b] = worker.stack.push(odd[b], k * rest);
    for (const Index c : out.children_of(b)) gather(b, c, part(at(c), group), all, y, w, worker);
    gather(b, -1, {std::max(all.begin, branch.own), all.end}, all, y, w, worker);
    for (std::size_t i = 0; i < at(f.pivots); ++i)
      for (std::size_t e = loads.begin[at(f.first) + i]; e < loads.begin[at(f.first) + i + 1]; ++e)
        if (const auto& entry = loads.entries[e]; entry.rank >= all.begin && entry.rank < all.end)
          y[entry.rank - all.begin + (3 * i + entry.unknown) * k] += entry.value;
    const double* panel = impl.l.data() + f.panel;
    worker.work.resize(k * dense::inverse_block);
    dense::solve_right(k, n, panel, m, impl.inverse_of(f), y, k, worker.work.data());
    if (rest > 0) dense::multiply(k, rest, n, -1.0, y, k, panel + n, m, 1.0, w, k);
    for (std::size_t i = 0; i < n; ++i)
      std::transform(y + i * k, y + (i + 1) * k, out.y.data() + out.index(all.begin, branch.depth + i),
                     [](double v) { return static_cast<Scalar>(v); });
    const auto children = out.children_of(b);
    for (std::size_t c = children.size(); c-- > 0;)
      worker.stack.pop(odd[at(children[c])], left(at(children[c]), group));
  }

  void run(int threads, const Progress& progress) {
    const std::size_t ranks = out.size();
    odd.assign(out.branches.size(), 0);
    for (std::size_t b = odd.size(); b-- > 0;)
      if (out.branches[b].parent >= 0) odd[b] = !odd[at(out.branches[b].parent)];
    std::size_t need = 0;
    for (std::size_t r = 0; r < ranks; r += group_rows)
      need = std::max(need, stack_need({r, std::min(ranks, r + group_rows)}));
    Pool<Worker> workers;
    SharedProgress shared(progress, static_cast<double>(ranks));
    parallel_for(ranks, group_rows, threads, [&](std::size_t begin, std::size_t end) {
      auto worker = workers.take(
          [&] { return std::make_unique<Worker>(sym.node_at.size(), out.branches.size(), need); });
      for (std::size_t b = 0; b < out.branches.size(); ++b)
        if (part(b, {begin, end}).size() > 0) visit(b, {begin, end}, *worker);
      workers.give(std::move(worker));
      shared.add(static_cast<double>(end - begin));
    });
  }
};

}  // namespace

template <class Scalar>
std::size_t Factored<Scalar>::arrange() {
  child_begin.assign(branches.size() + 1, 0);
  for (const Branch& b : branches)
    if (b.parent >= 0) ++child_begin[at(b.parent) + 1];
  std::partial_sum(child_begin.begin(), child_begin.end(), child_begin.begin());
  children.resize(at(child_begin.back()));
  std::vector<Index> fill(child_begin.begin(), child_begin.end() - 1);
  for (std::size_t b = 0; b < branches.size(); ++b)
    if (const Index p = branches[b].parent; p >= 0) children[at(fill[at(p)]++)] = static_cast<Index>(b);

  std::vector<std::size_t> path((size() + panel_rows - 1) / panel_rows, 0);
  for (const Branch& b : branches)
    for (std::size_t p = b.own / panel_rows; p * panel_rows < b.end; ++p)
      if (b.own < b.end) path[p] = std::max(path[p], b.path());
  std::size_t total = 0;
  panel_offset.clear();
  for (std::size_t p = 0; p < path.size(); ++p) {
    panel_offset.push_back(total);
    total += path[p] * leading(p * panel_rows);
  }
  return total;
}

namespace {

template <class Scalar>
Factored<Scalar> plan(const Symbolic& sym, const Loads& loads) {
  Factored<Scalar> out;
  out.load_at = loads.order;
  make_branches(sym, loads, out);
  return out;
}

}  // namespace

Factored<float> factored_outline(const Symbolic& symbolic, const Sparse& loads) {
  return plan<float>(symbolic, sort_loads(symbolic, loads));
}

template <class Scalar>
Factored<Scalar> factor_compliance(const Cholesky& cholesky, const Sparse& matrix, int threads,
                                   const Progress& progress) {
  static_assert(Factored<Scalar>::panel_rows % group_rows == 0 && group_rows % 3 == 0);
  const Cholesky::Impl& impl = cholesky.impl();
  const Loads loads = sort_loads(impl.symbolic, matrix);
  Factored<Scalar> out = plan<Scalar>(impl.symbolic, loads);
  out.y = HugeArray<Scalar>(out.arrange());
  Walk<Scalar>{impl, impl.symbolic, loads, out, {}}.run(threads, progress);
  return out;
}

template struct Factored<float>;
template struct Factored<double>;
template Factored<float> factor_compliance(const Cholesky&, const Sparse&, int, const Progress&);
template Factored<double> factor_compliance(const Cholesky&, const Sparse&, int, const Progress&);

}  // namespace palpate
