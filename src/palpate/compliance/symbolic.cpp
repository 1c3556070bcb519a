#include "palpate/compliance/symbolic.hpp"

#include <algorithm>
#include <numeric>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

std::vector<Index> inverse(const std::vector<Index>& order, std::size_t nodes) {
  std::vector<Index> position(nodes, -1);
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (order[k] < 0 || at(order[k]) >= nodes || position[at(order[k])] >= 0)
      throw Error(ErrorKind::internal, "elimination order is no permutation at {}", k);
    position[at(order[k])] = static_cast<Index>(k);
  }
  if (order.size() != nodes)
    throw Error(ErrorKind::internal, "elimination order of {} nodes has {}", nodes, order.size());
  return position;
}

// Parent of each position in the elimination tree (Liu, with path compression).
std::vector<Index> elimination_tree(const NodeGraph& graph, const std::vector<Index>& order,
                                    const std::vector<Index>& position) {
  std::vector<Index> parent(order.size(), -1), ancestor(order.size(), -1);
  for (Index k = 0; k < static_cast<Index>(order.size()); ++k)
    for (const Index neighbour : graph.of(order[at(k)]))
      for (Index i = position[at(neighbour)]; i >= 0 && i < k;) {
        const Index next = std::exchange(ancestor[at(i)], k);
        if (next < 0) parent[at(i)] = k;
        i = next;
      }
  return parent;
}

// Vertices of a forest, children before parents, every subtree contiguous.
std::vector<Index> postorder(const std::vector<Index>& parent) {
  const std::size_t n = parent.size();
  std::vector<Index> head(n + 1, -1), next(n, -1), order, stack;
  for (std::size_t k = n; k-- > 0;) {  // backwards: lists come out ascending; roots hang on n
    const std::size_t p = parent[k] < 0 ? n : at(parent[k]);
    next[k] = std::exchange(head[p], static_cast<Index>(k));
  }
  order.reserve(n);
  for (Index root = head[n]; root >= 0; root = next[at(root)]) {
    stack.push_back(root);
    while (!stack.empty()) {
      const Index top = stack.back();
      const Index child = head[at(top)];
      if (child >= 0) {
        head[at(top)] = next[at(child)];
        stack.push_back(child);
      } else {
        order.push_back(top);
        stack.pop_back();
      }
    }
  }
  return order;
}

// Number of nodes below the diagonal of each column of L: every row's nonzeros are a subtree, walked once.
std::vector<Index> column_counts(const NodeGraph& graph, const std::vector<Index>& order,
                                 const std::vector<Index>& position, const std::vector<Index>& parent) {
  std::vector<Index> count(order.size(), 0), seen(order.size(), -1);
  for (Index k = 0; k < static_cast<Index>(order.size()); ++k) {
    seen[at(k)] = k;
    for (const Index neighbour : graph.of(order[at(k)]))
      for (Index i = position[at(neighbour)]; i < k && seen[at(i)] != k; i = parent[at(i)]) {
        seen[at(i)] = k;
        ++count[at(i)];
      }
  }
  return count;
}

// Sets of positions that become fronts: a forest of its own.
struct Groups {
  std::vector<Index> of;                 // group of each position
  std::vector<Index> parent;             // of each group
  std::vector<Index> size, below;        // nodes of a group, and below it
  std::vector<double> zeros;             // entries of L (node blocks) that are stored, but zero
  std::vector<std::vector<Index>> kids;  // children of each group
};

// Fundamental supernodes: chains of columns of the same structure.
Groups supernodes(const std::vector<Index>& parent, const std::vector<Index>& count) {
  Groups g;
  const std::size_t n = parent.size();
  g.of.resize(n);
  std::vector<Index> children(n, 0);
  for (const Index p : parent)
    if (p >= 0) ++children[at(p)];
  for (std::size_t k = 0; k < n; ++k) {
    const bool joined = k > 0 && at(parent[k - 1]) == k && count[k - 1] == count[k] + 1 && children[k] == 1;
    if (!joined) g.size.push_back(0), g.below.push_back(0), g.parent.push_back(-1);
    g.of[k] = static_cast<Index>(g.size.size() - 1);
    ++g.size.back();
    g.below.back() = count[k];
    g.parent.back() = parent[k];  // a position for now
  }
  g.kids.resize(g.size.size());
  g.zeros.assign(g.size.size(), 0);
  for (std::size_t s = 0; s < g.size.size(); ++s) {
    if (g.parent[s] < 0) continue;
    g.parent[s] = g.of[at(g.parent[s])];
    g.kids[at(g.parent[s])].push_back(static_cast<Index>(s));
  }
  return g;
}

double allowed_zeros(std::span<const Relaxation> relaxation, Index nodes) {
  for (const Relaxation& r : relaxation)
    if (nodes <= r.nodes) return r.zeros;
  return -1;  // not even none
}

// Merges children into their parents where that costs few zeros; parents after children, as numbered.
void amalgamate(Groups& g, std::span<const Relaxation> relaxation) {
  std::vector<Index> into(g.size.size());
  std::iota(into.begin(), into.end(), 0);
  for (std::size_t p = 0; p < g.size.size(); ++p) {
    std::vector<Index> kids = std::move(g.kids[p]), kept;
    const auto padding = [&](Index c) {  // of the child's columns, once they are as high as the parent's
      return static_cast<double>(g.size[at(c)]) * (g.size[p] + g.below[p] - g.below[at(c)]);
    };
    std::stable_sort(kids.begin(), kids.end(), [&](Index a, Index b) { return padding(a) < padding(b); });
    for (const Index c : kids) {
      const Index size = g.size[at(c)] + g.size[p];
      const double zeros = g.zeros[at(c)] + g.zeros[p] + padding(c);
      const double entries = 0.5 * size * (size + 1.0) + static_cast<double>(size) * g.below[p];
      if (zeros > entries * allowed_zeros(relaxation, size)) {
        kept.push_back(c);
        continue;
      }
      into[at(c)] = static_cast<Index>(p);
      g.size[p] = size;
      g.zeros[p] = zeros;
      kept.insert(kept.end(), g.kids[at(c)].begin(), g.kids[at(c)].end());
    }
    g.kids[p] = std::move(kept);
  }
  for (std::size_t s = g.size.size(); s-- > 0;) into[s] = into[at(into[s])];  // parents are final first
  for (Index& s : g.of) s = into[at(s)];
  for (std::size_t s = 0; s < g.size.size(); ++s)
    if (into[s] == static_cast<Index>(s) && g.parent[s] >= 0) g.parent[s] = into[at(g.parent[s])];
}

// The fronts in postorder of the merged forest, and the elimination order that goes with it.
void number_fronts(const Groups& g, const std::vector<Index>& order, Symbolic& out) {
  const std::size_t groups = g.size.size(), n = order.size();
  std::vector<std::vector<Index>> members(groups);
  for (std::size_t k = 0; k < n; ++k) members[at(g.of[k])].push_back(static_cast<Index>(k));
  std::vector<Index> front_of(groups, -1);
  for (const Index s : postorder(g.parent)) {
    if (members[at(s)].empty()) continue;  // merged away
    front_of[at(s)] = static_cast<Index>(out.fronts.size());
    Front f;
    f.first = static_cast<Index>(out.node_at.size());
    f.pivots = static_cast<Index>(members[at(s)].size());
    for (const Index k : members[at(s)]) out.node_at.push_back(order[at(k)]);
    f.parent = g.parent[at(s)];
    out.fronts.push_back(f);
  }
  for (Front& f : out.fronts)
    if (f.parent >= 0) f.parent = front_of[at(f.parent)];
  out.position_of = inverse(out.node_at, n);
}

void link_children(Symbolic& out) {
  out.child_begin.assign(out.fronts.size() + 1, 0);
  for (const Front& f : out.fronts)
    if (f.parent >= 0) ++out.child_begin[at(f.parent) + 1];
  std::partial_sum(out.child_begin.begin(), out.child_begin.end(), out.child_begin.begin());
  out.children.resize(static_cast<std::size_t>(out.child_begin.back()));
  std::vector<Index> fill(out.child_begin.begin(), out.child_begin.end() - 1);
  for (std::size_t s = 0; s < out.fronts.size(); ++s)
    if (const Index p = out.fronts[s].parent; p >= 0) out.children[at(fill[at(p)]++)] = static_cast<Index>(s);
}

// Positions below each front: those of the matrix and of the children. Then each one's place in the parent.
void find_rows(const NodeGraph& graph, Symbolic& out) {
  std::vector<Index> seen(out.node_at.size(), -1), place(out.node_at.size(), -1);
  for (std::size_t s = 0; s < out.fronts.size(); ++s) {
    Front& f = out.fronts[s];
    const Index end = f.first + f.pivots;
    f.rows = out.rows.size();
    const auto add = [&](Index row) {
      if (row >= end && std::exchange(seen[at(row)], static_cast<Index>(s)) != static_cast<Index>(s))
        out.rows.push_back(row);
    };
    for (Index k = f.first; k < end; ++k)
      for (const Index neighbour : graph.of(out.node_at[at(k)])) add(out.position_of[at(neighbour)]);
    for (const Index c : out.children_of(s)) {
      const Front& child = out.fronts[at(c)];
      for (std::size_t i = 0; i < at(child.below); ++i) add(out.rows[child.rows + i]);
    }
    f.below = static_cast<Index>(out.rows.size() - f.rows);
    std::sort(out.rows.begin() + static_cast<std::ptrdiff_t>(f.rows), out.rows.end());
    f.panel = out.panel_entries;
    out.panel_entries += f.height() * f.width();

    for (Index i = 0; i < f.below; ++i) place[at(out.rows[f.rows + at(i)])] = f.pivots + i;
    out.place.resize(out.rows.size());
    for (const Index c : out.children_of(s)) {
      const Front& child = out.fronts[at(c)];
      for (std::size_t i = child.rows; i < child.rows + at(child.below); ++i)
        out.place[i] = out.rows[i] < end ? out.rows[i] - f.first : place[at(out.rows[i])];
    }
  }
}

}  // namespace

std::span<const Relaxation> default_relaxation() {
  static constexpr Relaxation values[] = {{8, 0.5}, {16, 0.2}};
  return values;
}

Symbolic analyse(const NodeGraph& graph, const std::vector<Index>& order,
                 std::span<const Relaxation> relaxation) {
  // Positions in postorder of the elimination tree: the same fill, and supernodes become contiguous.
  std::vector<Index> position = inverse(order, graph.nodes());
  std::vector<Index> tidy = postorder(elimination_tree(graph, order, position));
  for (Index& k : tidy) k = order[at(k)];
  position = inverse(tidy, graph.nodes());
  const std::vector<Index> parent = elimination_tree(graph, tidy, position);

  Groups groups = supernodes(parent, column_counts(graph, tidy, position, parent));
  amalgamate(groups, relaxation);
  Symbolic out;
  number_fronts(groups, tidy, out);
  link_children(out);
  find_rows(graph, out);
  return out;
}

}  // namespace palpate
