#include "palpate/compliance/compliance_file.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/base/error.hpp"
#include "palpate/compliance/storage.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

constexpr const char* packed_meaning =
    "lower triangle of the symmetric compliance by rows; row 3 r + a: displacement a of row r";

template <class T>
HugeArray<T> pack(std::span<const T> full, std::size_t n) {
  HugeArray<T> packed(n * (n + 1) / 2);
  T* to = packed.data();
  for (std::size_t i = 0; i < n; ++i) to = std::copy_n(full.data() + i * n, i + 1, to);
  return packed;
}

class Reader {
 public:
  Reader(const ContainerReader& in, const std::string& path, std::size_t nodes, bool verify,
         const Progress& progress)
      : in_(in), path_(path), nodes_(nodes), verify_(verify), progress_(progress) {}

  Compliance read() const {
    const std::string storage = in_.text("storage");
    if (storage == storage_name(Storage::dense)) return Compliance::dense(full<float>(), nodes_);
    if (storage == storage_name(Storage::half)) return half();
    if (storage == storage_name(Storage::factored)) return factored();
    if (storage == storage_name(Storage::hierarchical)) return hierarchical();
    throw Error(ErrorKind::format, "{}: its compliance is stored as '{}', which this program does not know",
                path_, storage);
  }

 private:
  void require(bool ok, const char* what) const {
    if (!ok) throw Error(ErrorKind::format, "{}: {}; the file is damaged: precompute it again", path_, what);
  }
  std::size_t size(const std::string& name) const {
    std::size_t n = 1;
    for (const std::size_t s : in_.shape(name)) n *= s;
    return n;
  }

  // The packed triangle is read into the end of the square, then spread row by row from the front: a row's
  // place in the square never lies behind its place in the packed part that is still to be read.
  template <class T>
  HugeArray<T> full() const {
    const std::size_t n = 3 * nodes_, packed_size = n * (n + 1) / 2;
    require(size("compliance/packed") == packed_size, "the compliance does not match the surface");
    HugeArray<T> c(n * n);
    in_.array<T>("compliance/packed", {c.data() + n * n - packed_size, packed_size}, verify_, progress_);
    const T* from = c.data() + n * n - packed_size;
    for (std::size_t i = 0; i < n; from += ++i) std::copy(from, from + i + 1, c.data() + i * n);
    constexpr std::size_t tile = 64;
    for (std::size_t bi = 0; bi < n; bi += tile)
      for (std::size_t bj = 0; bj <= bi; bj += tile)
        for (std::size_t i = bi; i < std::min(n, bi + tile); ++i)
          for (std::size_t j = bj; j < std::min(i, bj + tile); ++j) c[j * n + i] = c[i * n + j];
    return c;
  }

  Compliance half() const {
    std::vector<float> scale = in_.vector<float>("compliance/scale");
    require(scale.size() == 3 * nodes_, "the compliance does not match the surface");
    return Compliance(std::make_shared<HalfCompliance>(full<std::uint16_t>(), std::move(scale)));
  }

  std::vector<Index> permutation(const std::string& name) const {
    std::vector<Index> out = in_.vector<Index>(name);
    require(out.size() == nodes_, "the compliance does not match the surface");
    std::vector<std::uint8_t> seen(nodes_, 0);
    for (const Index i : out)
      require(i >= 0 && at(i) < nodes_ && !seen[at(i)]++, "an order of nodes is none");
    return out;
  }

  // Branches in postorder: own loads of one after those of the other, all below it before.
  Compliance factored() const {
    Factored<float> y;
    y.load_at = permutation("compliance/order");
    const std::vector<Index> b = in_.vector<Index>("compliance/branches");
    require(b.size() % 5 == 0, "branches are cut short");
    y.branches.resize(b.size() / 5);
    std::size_t rank = 0;
    for (std::size_t i = 0; i < y.branches.size(); ++i) {
      auto& branch = y.branches[i];
      const Index* v = b.data() + 5 * i;
      for (int k = 0; k < 4; ++k) require(v[k] >= 0 && v[k] % 3 == 0, "a branch is out of range");
      branch.begin = at(v[0]), branch.own = at(v[1]), branch.end = at(v[2]), branch.width = at(v[3]);
      branch.parent = v[4];
      require(branch.begin <= branch.own && branch.own == rank && branch.own <= branch.end &&
                  branch.begin < branch.end && branch.end <= 3 * nodes_ && branch.width > 0 &&
                  (branch.parent == -1 || (at(branch.parent) > i && at(branch.parent) < y.branches.size())),
              "branches are not in order");
      rank = branch.end;
    }
    require(rank == 3 * nodes_, "branches do not have all nodes");
    for (std::size_t i = y.branches.size(); i-- > 0;)
      if (const Index p = y.branches[i].parent; p >= 0) {
        auto &branch = y.branches[i], &parent = y.branches[at(p)];
        require(branch.begin >= parent.begin && branch.end <= parent.own, "a branch leaves its parent");
        branch.depth = parent.path();
        require(branch.depth < std::size_t{1} << 40, "a path is too long");
      }
    require(y.arrange() == size("compliance/values"), "the compliance does not match its branches");
    y.y = HugeArray<float>(size("compliance/values"));
    in_.array<float>("compliance/values", y.y, verify_, progress_);
    return Compliance(std::make_shared<FactoredCompliance>(std::move(y)));
  }

  Compliance hierarchical() const {
    Hierarchical h;
    h.nodes = nodes_;
    const std::int64_t levels = in_.integer("levels");
    require(levels >= 0 && levels < 32 && std::size_t{1} << levels <= nodes_, "its tree is too deep");
    h.levels = static_cast<int>(levels);
    h.tolerance = in_.number("tolerance"), h.error = in_.number("error"), h.lowest = in_.number("lowest");
    h.order = permutation("compliance/order");
    h.rank = in_.vector<Index>("compliance/ranks");
    require(h.rank.size() == h.clusters(), "ranks do not match the tree");
    for (const Index r : h.rank) require(r >= 0 && at(r) <= 3 * nodes_, "a rank is out of range");
    const std::vector<Index> b = in_.vector<Index>("compliance/blocks");
    require(b.size() % 3 == 0, "blocks are cut short");
    for (std::size_t i = 0; i < b.size(); i += 3) {
      Hierarchical::Block block{b[i], b[i + 1], b[i + 2] != 0, 0};
      require(block.column >= 0 && block.row >= block.column && at(block.row) < h.clusters() &&
                  Hierarchical::level(at(block.row)) == Hierarchical::level(at(block.column)) &&
                  (!block.near || h.leaf(at(block.row))),
              "a block is out of range");
      require(h.blocks.empty() ||
                  std::pair(h.blocks.back().row, h.blocks.back().column) < std::pair(block.row, block.column),
              "blocks are not in order");
      h.blocks.push_back(block);
    }
    require(h.arrange() == size("compliance/values"), "the compliance does not match its blocks");
    h.values = HugeArray<float>(size("compliance/values"));
    in_.array<float>("compliance/values", h.values, verify_, progress_);
    return Compliance(std::make_shared<HierarchicalCompliance>(std::move(h)));
  }

  const ContainerReader& in_;
  const std::string& path_;
  std::size_t nodes_;
  bool verify_;
  const Progress& progress_;
};

void write_factored(ContainerWriter& out, const Factored<float>& y, const Progress& progress) {
  std::vector<Index> b;
  for (const auto& branch : y.branches) {
    for (const std::size_t v : {branch.begin, branch.own, branch.end, branch.width})
      b.push_back(static_cast<Index>(v));
    b.push_back(branch.parent);
  }
  out.array<Index>("compliance/order", y.load_at, {y.load_at.size()}, "",
                   "row at each place of the elimination");
  out.array<Index>("compliance/branches", b, {y.branches.size(), 5}, "",
                   "fronts in postorder: first unknown below it, own first, end, rows of Y, parent");
  out.array<float>(
      "compliance/values", y.y, {y.y.size()}, "m^1/2/N^1/2",
      "Y of C = Y^T Y: panels of 1,920 unknowns in the order of the elimination, each column-major, "
      "as many columns as the longest path from the root has",
      progress);
}

void write_hierarchical(ContainerWriter& out, const Hierarchical& h, const Progress& progress) {
  std::vector<Index> b;
  for (const auto& block : h.blocks) b.insert(b.end(), {block.row, block.column, block.near});
  out.attribute("levels", static_cast<std::int64_t>(h.levels));
  out.attribute("tolerance", h.tolerance);
  out.attribute("error", h.error);
  out.attribute("lowest", h.lowest);
  out.array<Index>("compliance/order", h.order, {h.order.size()}, "",
                   "row at each place of the cluster tree");
  out.array<Index>("compliance/ranks", h.rank, {h.rank.size()}, "",
                   "width of the basis of each cluster; the children of c are 2 c + 1, 2 c + 2");
  out.array<Index>("compliance/blocks", b, {h.blocks.size(), 3}, "", "row cluster, column cluster, 1: near");
  out.array<float>(
      "compliance/values", h.values, {h.values.size()}, "m/N, 1",
      "for each cluster: a leaf's basis, then the transfer into the parent's; then the blocks; all "
      "column-major",
      progress);
}

}  // namespace

void write_compliance(ContainerWriter& out, const Compliance& compliance, const Progress& progress) {
  out.attribute("storage", compliance.storage());
  const std::size_t n = 3 * compliance.nodes();
  if (const auto* dense = compliance.as<DenseCompliance>()) {
    const HugeArray<float> packed = pack(dense->matrix(), n);
    out.array<float>("compliance/packed", packed, {packed.size()}, "m/N", packed_meaning, progress);
  } else if (const auto* half = compliance.as<HalfCompliance>()) {
    const HugeArray<std::uint16_t> packed = pack(half->values(), n);
    out.array<float>("compliance/scale", half->scale(), {n}, "m^1/2/N^1/2",
                     "C_ij is scale_i scale_j times the packed number");
    out.array<std::uint16_t>("compliance/packed", packed, {packed.size()}, "1", packed_meaning, progress);
  } else if (const auto* factored = compliance.as<FactoredCompliance>()) {
    write_factored(out, factored->factored(), progress);
  } else if (const auto* hierarchical = compliance.as<HierarchicalCompliance>()) {
    write_hierarchical(out, hierarchical->matrix(), progress);
  }
}

Compliance read_compliance(const ContainerReader& in, const std::string& path, std::size_t nodes, bool verify,
                           const Progress& progress) {
  return Reader(in, path, nodes, verify, progress).read();
}

}  // namespace palpate
