#include <algorithm>
#include <numeric>

#include "palpate/compliance/rows.hpp"
#include "palpate/compliance/storage.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

enum : std::uint8_t { silent, speaks };  // of clusters in work.active

// y += A x, A m x n column-major.
void add_product(const float* a, std::size_t m, std::size_t n, const float* x, float* y) noexcept {
  for (std::size_t k = 0; k < n; k += rows_at_once) {
    const float* columns[rows_at_once];
    const std::size_t count = std::min(rows_at_once, n - k);
    for (std::size_t i = 0; i < count; ++i) columns[i] = a + (k + i) * m;
    add_rows(columns, x + k, count, m, y);
  }
}

void prefetch(const float* values, std::size_t count) noexcept {
  constexpr std::size_t line = 16;
  for (std::size_t i = 0; i < count + line - 1; i += line)
    __builtin_prefetch(values + std::min(i, count - 1));
}

void add(bool mirrored, const float* a, std::size_t to, std::size_t from, const float* x, float* y) noexcept {
  mirrored ? add_dots(a, from, to, x, y) : add_product(a, to, from, x, y);
}

}  // namespace

struct HierarchicalCompliance::WorkSpace final : ComplianceWork {
  std::vector<float> x, y, u, f;
  std::vector<std::uint8_t> active;
  std::vector<Index> list;
  std::vector<const Link*> link;    // of each cluster in `list`, as that of the row at hand sees it; or null
  std::vector<const float*> entry;  // of each column: where the 3 x 3 block with the row at hand begins
};

HierarchicalCompliance::WorkSpace& HierarchicalCompliance::threads_own() {
  static thread_local WorkSpace own;  // its first use allocates even where nothing is put into it
  return own;
}

HierarchicalCompliance::WorkSpace& HierarchicalCompliance::work_space(ComplianceWork* given) const {
  auto* work = dynamic_cast<WorkSpace*>(given);
  if (!work) work = &threads_own();
  prepare(*work);
  return *work;
}

// Sizes only grow: a thread may ask several matrices in turn.
void HierarchicalCompliance::prepare(WorkSpace& w) const {
  const auto grow = [](auto& vector, std::size_t size) {
    if (vector.size() < size) vector.resize(size);
  };
  grow(w.x, 3 * coefficients_), grow(w.y, 3 * coefficients_);
  grow(w.u, 9 * h_.nodes), grow(w.f, 3 * h_.nodes);
  grow(w.active, h_.clusters()), grow(w.link, h_.clusters()), grow(w.entry, h_.nodes);
  w.list.reserve(h_.clusters());
}

std::unique_ptr<ComplianceWork> HierarchicalCompliance::make_work() const {
  auto work = std::make_unique<WorkSpace>();
  prepare(*work);
  return work;
}

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
                                   std::span<float> u, ComplianceWork* work) const noexcept {
  const std::size_t clusters = h_.clusters();
  WorkSpace& w = work_space(work);
  std::fill_n(w.x.data(), coefficients_, 0.0f), std::fill_n(w.y.data(), coefficients_, 0.0f);
  std::fill_n(w.f.data(), 3 * h_.nodes, 0.0f), std::fill_n(w.u.data(), 3 * h_.nodes, 0.0f);
  std::fill_n(w.active.data(), clusters, std::uint8_t{silent});
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

// The coefficients of unit forces on a node in cluster c, three for each, into x + 3 first_; those of the
// cluster's child that it is in are there.
void HierarchicalCompliance::expand(std::size_t place, std::size_t c, float* x) const noexcept {
  const std::size_t width = h_.width(c);
  float* to = x + 3 * first_[c];
  if (h_.leaf(c)) {
    const float* row = h_.values.data() + h_.basis[c] + 3 * (place - h_.begin(c));
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t k = 0; k < width; ++k) to[a * width + k] = row[k * h_.unknowns(c) + a];
    return;
  }
  const std::size_t child = place < h_.end(2 * c + 1) ? 2 * c + 1 : 2 * c + 2, n = h_.width(child);
  std::fill_n(to, 3 * width, 0.0f);
  for (std::size_t a = 0; a < 3; ++a)
    add_dots(h_.values.data() + h_.transfer[child], n, width, x + 3 * first_[child] + a * n, to + a * width);
}

// The links between the clusters in work.list and those that the node is in, and which of them speak. All
// numbers that spread() will read are scattered over megabytes: they are fetched while others are looked up.
void HierarchicalCompliance::find_links(std::size_t place, WorkSpace& w) const noexcept {
  const std::size_t leaf = at(leaf_of_[place]);
  int expanded = h_.levels + 1;
  for (const Index target : w.list) {
    const std::size_t c = at(target), n = h_.width(c), parent = (c - 1) / 2;
    const int level = Hierarchical::level(c);
    const std::size_t own = cluster_above(leaf, level);
    const Link* link = w.link[c] = find(own, c);
    const bool far = link && !link->near, above = c > 0 && w.active[parent] == speaks;
    w.active[c] = far || above ? speaks : silent;
    if (far) prefetch(link->values, n * h_.width(own));
    if (above) prefetch(h_.values.data() + h_.transfer[c], n * h_.width(parent));
    if (h_.leaf(c) && w.active[c] == speaks) prefetch(h_.values.data() + h_.basis[c], h_.unknowns(c) * n);
    for (; far && expanded > level; --expanded) {
      const std::size_t up = cluster_above(leaf, expanded - 1), rows_of_leaf = h_.unknowns(leaf);
      if (!h_.leaf(up)) {
        const std::size_t child = cluster_above(leaf, expanded);
        prefetch(h_.values.data() + h_.transfer[child], h_.width(child) * h_.width(up));
        continue;
      }
      const float* basis = h_.values.data() + h_.basis[leaf] + 3 * (place - h_.begin(leaf));
      for (std::size_t k = 0; k < h_.width(leaf); ++k) __builtin_prefetch(basis + k * rows_of_leaf);
    }
  }
}

// What unit forces on the node at `place` do to the clusters in work.list: y, three for each coefficient, and
// in the leaves u, three for each unknown, but for near leaves. Contacts are near each other, so most
// clusters above the leaves have nothing to say; they are left out.
void HierarchicalCompliance::spread(std::size_t place, WorkSpace& w) const noexcept {
  const std::size_t leaf = at(leaf_of_[place]);
  int expanded = h_.levels + 1;  // the clusters of these levels and below that the node is in have their x
  for (const Index target : w.list) {
    const std::size_t c = at(target), n = h_.width(c), parent = (c - 1) / 2;
    if (w.active[c] != speaks) continue;
    const int level = Hierarchical::level(c);
    const Link* link = w.link[c];
    const bool far = link && !link->near, above = c > 0 && w.active[parent] == speaks;
    float* y = w.y.data() + 3 * first_[c];
    std::fill_n(y, 3 * n, 0.0f);
    if (above)
      for (std::size_t a = 0; a < 3; ++a)
        add_product(h_.values.data() + h_.transfer[c], n, h_.width(parent),
                    w.y.data() + 3 * first_[parent] + a * h_.width(parent), y + a * n);
    if (far) {
      while (expanded > level) expand(place, cluster_above(leaf, --expanded), w.x.data());
      const std::size_t from = cluster_above(leaf, level);
      for (std::size_t a = 0; a < 3; ++a)
        add(!link->mirrored, link->values, n, h_.width(from),
            w.x.data() + 3 * first_[from] + a * h_.width(from), y + a * n);
    }
    if (!h_.leaf(c)) continue;
    float* u = w.u.data() + 9 * h_.begin(c);
    std::fill_n(u, 3 * h_.unknowns(c), 0.0f);
    for (std::size_t a = 0; a < 3; ++a)
      add_product(h_.values.data() + h_.basis[c], h_.unknowns(c), n, y + a * n, u + a * h_.unknowns(c));
  }
}

void HierarchicalCompliance::block(std::span<const Index> rows, std::span<const Index> columns,
                                   std::span<float> out, std::size_t ld,
                                   ComplianceWork* work) const noexcept {
  WorkSpace& w = work_space(work);
  std::fill_n(w.active.data(), h_.clusters(), std::uint8_t{silent});
  w.list.clear();
  if (w.entry.size() < columns.size()) w.entry.resize(columns.size());  // repeated ones
  for (const Index node : columns)
    for (std::size_t c = at(leaf_of_[at(place_of_[at(node)])]); !w.active[c]; c = (c - 1) / 2) {
      w.active[c] = 1;
      w.list.push_back(static_cast<Index>(c));
      if (c == 0) break;
    }
  std::sort(w.list.begin(), w.list.end());  // parents first
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::size_t place = at(place_of_[at(rows[i])]), leaf = at(leaf_of_[place]);
    const std::size_t row = 3 * (place - h_.begin(leaf)), size = h_.unknowns(leaf);
    find_links(place, w);
    // A near block as the row's leaf sees it is stored column by column of the other, or mirrored.
    const auto turned = [&](std::size_t c) { return w.link[c]->mirrored || c == leaf; };
    for (std::size_t j = 0; j < columns.size(); ++j) {
      const std::size_t p = at(place_of_[at(columns[j])]), c = at(leaf_of_[p]);
      const std::size_t m = h_.unknowns(c), column = 3 * (p - h_.begin(c));
      const Link* link = w.link[c];
      w.entry[j] = nullptr;
      if (!link || !link->near) continue;
      w.entry[j] = link->values + (turned(c) ? row * m + column : column * size + row);
      for (std::size_t a = 0; a < 3; ++a) __builtin_prefetch(w.entry[j] + a * (turned(c) ? m : size));
    }
    spread(place, w);
    for (std::size_t j = 0; j < columns.size(); ++j) {
      const std::size_t p = at(place_of_[at(columns[j])]), c = at(leaf_of_[p]), m = h_.unknowns(c);
      const float* u = w.active[c] == speaks ? w.u.data() + 9 * h_.begin(c) + 3 * (p - h_.begin(c)) : nullptr;
      const float* entry = w.entry[j];
      const std::size_t by_row = entry && turned(c) ? m : 1, by_column = entry && turned(c) ? 1 : size;
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b) {
          float sum = u ? u[a * m + b] : 0;
          if (entry) sum += entry[a * by_row + b * by_column];
          out[(3 * i + a) * ld + 3 * j + b] = sum;
        }
    }
  }
}

}  // namespace palpate
