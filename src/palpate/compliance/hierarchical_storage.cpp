#include <algorithm>
#include <numeric>

#include "palpate/compliance/rows.hpp"
#include "palpate/compliance/storage.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

struct WorkSpace {
  std::vector<float> x, y, u, f;
  std::vector<std::uint8_t> active;
  std::vector<Index> list;
};
WorkSpace& work_space() {
  static thread_local WorkSpace memory;
  return memory;
}

// y += A x, A m x n column-major.
void add_product(const float* a, std::size_t m, std::size_t n, const float* x, float* y) noexcept {
  for (std::size_t k = 0; k < n; k += rows_at_once) {
    const float* columns[rows_at_once];
    const std::size_t count = std::min(rows_at_once, n - k);
    for (std::size_t i = 0; i < count; ++i) columns[i] = a + (k + i) * m;
    add_rows(columns, x + k, count, m, y);
  }
}

void add(bool mirrored, const float* a, std::size_t to, std::size_t from, const float* x, float* y) noexcept {
  mirrored ? add_dots(a, from, to, x, y) : add_product(a, to, from, x, y);
}

}  // namespace

HierarchicalCompliance::HierarchicalCompliance(Hierarchical matrix) : h_(std::move(matrix)) {
  const std::size_t clusters = h_.clusters();
  link_begin_.assign(clusters + 1, 0);
  for (const auto& b : h_.blocks) {
    ++link_begin_[at(b.row) + 1];
    if (b.row != b.column) ++link_begin_[at(b.column) + 1];
  }
  std::partial_sum(link_begin_.begin(), link_begin_.end(), link_begin_.begin());
  links_.resize(link_begin_.back());
  std::vector<std::size_t> fill(link_begin_.begin(), link_begin_.end() - 1);
  for (const auto& b : h_.blocks) {  // ascending rows and columns: the links come out ascending
    const float* values = h_.values.data() + b.values;
    links_[fill[at(b.row)]++] = {b.column, b.near, false, values};
    if (b.row != b.column) links_[fill[at(b.column)]++] = {b.row, b.near, true, values};
  }
  place_of_.resize(h_.nodes), leaf_of_.resize(h_.nodes);
  for (std::size_t p = 0; p < h_.nodes; ++p) place_of_[at(h_.order[p])] = static_cast<Index>(p);
  for (std::size_t c = 0; c < clusters; ++c) {
    first_.push_back(coefficients_);
    coefficients_ += h_.width(c);
    for (std::size_t p = h_.begin(c); h_.leaf(c) && p < h_.end(c); ++p) leaf_of_[p] = static_cast<Index>(c);
  }
}

const HierarchicalCompliance::Link* HierarchicalCompliance::find(std::size_t c,
                                                                 std::size_t other) const noexcept {
  const auto all = links(c);
  const auto found = std::lower_bound(all.begin(), all.end(), static_cast<Index>(other),
                                      [](const Link& l, Index o) { return l.other < o; });
  return found != all.end() && found->other == static_cast<Index>(other) ? &*found : nullptr;
}

// Up the tree with the forces, across, and down the tree with the displacements.
void HierarchicalCompliance::apply(std::span<const Index> contacts, std::span<const float> forces,
                                   std::span<float> u) const noexcept {
  const std::size_t clusters = h_.clusters();
  WorkSpace& w = work_space();
  w.x.assign(coefficients_, 0), w.y.assign(coefficients_, 0);
  w.f.assign(3 * h_.nodes, 0), w.u.assign(3 * h_.nodes, 0);
  w.active.assign(clusters, 0);
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const std::size_t place = at(place_of_[at(contacts[i])]);
    std::copy_n(forces.data() + 3 * i, 3, w.f.data() + 3 * place);
    for (std::size_t c = at(leaf_of_[place]); !w.active[c]; c = (c - 1) / 2) {
      w.active[c] = 1;
      if (c == 0) break;
    }
  }
  for (std::size_t c = clusters; c-- > 0;) {
    if (!w.active[c]) continue;
    float* x = w.x.data() + first_[c];
    if (h_.leaf(c))
      add_dots(h_.values.data() + h_.basis[c], h_.unknowns(c), h_.width(c), w.f.data() + 3 * h_.begin(c), x);
    if (c > 0)
      add_dots(h_.values.data() + h_.transfer[c], h_.width(c), h_.width((c - 1) / 2), x,
               w.x.data() + first_[(c - 1) / 2]);
    for (const Link& link : links(c)) {  // the block's other side takes from here
      const std::size_t o = at(link.other);
      if (link.near)
        add(!link.mirrored, link.values, h_.unknowns(o), h_.unknowns(c), w.f.data() + 3 * h_.begin(c),
            w.u.data() + 3 * h_.begin(o));
      else
        add(!link.mirrored, link.values, h_.width(o), h_.width(c), x, w.y.data() + first_[o]);
    }
  }
  for (std::size_t c = 0; c < clusters; ++c) {
    float* y = w.y.data() + first_[c];
    if (c > 0)
      add_product(h_.values.data() + h_.transfer[c], h_.width(c), h_.width((c - 1) / 2),
                  w.y.data() + first_[(c - 1) / 2], y);
    if (h_.leaf(c))
      add_product(h_.values.data() + h_.basis[c], h_.unknowns(c), h_.width(c), y,
                  w.u.data() + 3 * h_.begin(c));
  }
  for (std::size_t p = 0; p < h_.nodes; ++p)
    std::copy_n(w.u.data() + 3 * p, 3, u.data() + 3 * at(h_.order[p]));
}

// The coefficients of unit forces on a node in all clusters that it is in: three for each, into x + 3 first_.
void HierarchicalCompliance::expand(std::size_t place, float* x) const noexcept {
  const std::size_t leaf = at(leaf_of_[place]), row = 3 * (place - h_.begin(leaf)), m = h_.unknowns(leaf);
  const std::size_t width = h_.width(leaf);
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t k = 0; k < width; ++k)
      x[3 * first_[leaf] + a * width + k] = h_.values[h_.basis[leaf] + k * m + row + a];
  for (std::size_t c = leaf; c > 0; c = (c - 1) / 2) {
    const std::size_t parent = (c - 1) / 2, k = h_.width(c), n = h_.width(parent);
    std::fill_n(x + 3 * first_[parent], 3 * n, 0.0f);
    for (std::size_t a = 0; a < 3; ++a)
      add_dots(h_.values.data() + h_.transfer[c], k, n, x + 3 * first_[c] + a * k,
               x + 3 * first_[parent] + a * n);
  }
}

void HierarchicalCompliance::block(std::span<const Index> rows, std::span<const Index> columns,
                                   std::span<float> out, std::size_t ld) const noexcept {
  WorkSpace& w = work_space();
  if (w.x.size() < 3 * coefficients_) w.x.resize(3 * coefficients_);
  if (w.y.size() < 3 * coefficients_) w.y.resize(3 * coefficients_);
  w.active.assign(h_.clusters(), 0);
  w.list.clear();
  for (const Index node : columns)
    for (std::size_t c = at(leaf_of_[at(place_of_[at(node)])]); !w.active[c]; c = (c - 1) / 2) {
      w.active[c] = 1;
      w.list.push_back(static_cast<Index>(c));
      if (c == 0) break;
    }
  std::sort(w.list.begin(), w.list.end());  // parents first
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::size_t place = at(place_of_[at(rows[i])]), leaf = at(leaf_of_[place]);
    expand(place, w.x.data());
    for (const Index target : w.list) {
      const std::size_t c = at(target), n = h_.width(c);
      float* y = w.y.data() + 3 * first_[c];
      std::fill_n(y, 3 * n, 0.0f);
      if (c > 0) {
        const std::size_t parent = (c - 1) / 2;
        for (std::size_t a = 0; a < 3; ++a)
          add_product(h_.values.data() + h_.transfer[c], n, h_.width(parent),
                      w.y.data() + 3 * first_[parent] + a * h_.width(parent), y + a * n);
      }
      // The cluster of this level that the row is in.
      const std::size_t from = ((leaf + 1) >> (h_.levels - Hierarchical::level(c))) - 1;
      const Link* link = find(c, from);
      if (!link || link->near) continue;
      for (std::size_t a = 0; a < 3; ++a)
        add(link->mirrored, link->values, n, h_.width(from),
            w.x.data() + 3 * first_[from] + a * h_.width(from), y + a * n);
    }
    for (std::size_t j = 0; j < columns.size(); ++j) {
      const std::size_t p = at(place_of_[at(columns[j])]), c = at(leaf_of_[p]);
      const std::size_t m = h_.unknowns(c), row = 3 * (p - h_.begin(c)), n = h_.width(c);
      const float* y = w.y.data() + 3 * first_[c];
      const Link* link = find(c, leaf);
      const std::size_t other = 3 * (place - h_.begin(leaf)), size = h_.unknowns(leaf);
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b) {
          float sum = 0;
          for (std::size_t k = 0; k < n; ++k) sum += h_.values[h_.basis[c] + k * m + row + b] * y[a * n + k];
          if (link && link->near)
            sum += link->mirrored ? link->values[(row + b) * size + other + a]
                                  : link->values[(other + a) * m + row + b];
          out[(3 * i + a) * ld + 3 * j + b] = sum;
        }
    }
  }
}

}  // namespace palpate
