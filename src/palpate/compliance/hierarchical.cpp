// Building: clusters, sketches of their far fields, nested bases, couplings.
#include "palpate/compliance/hierarchical.hpp"

#include <Eigen/Eigenvalues>
#include <atomic>
#include <cmath>
#include <mutex>
#include <random>

#include "palpate/base/error.hpp"
#include "palpate/compliance/sketches.hpp"
#include "palpate/compliance/storage.hpp"

namespace palpate {

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

constexpr std::size_t leaf_nodes = 32;  // at most
constexpr unsigned seed = 1;
constexpr double separation = 3;  // far: the larger diameter is at most this times the distance

struct Ball {
  Vec3 center = Vec3::Zero();
  double radius = 0;
};

bool far(const Ball& a, const Ball& b) {
  const double distance = (a.center - b.center).norm() - a.radius - b.radius;
  return 2 * std::max(a.radius, b.radius) <= separation * distance;
}

// Halves each cluster across its longest side.
void order_nodes(Hierarchical& h, std::span<const Vec3> positions) {
  h.order.resize(h.nodes);
  std::iota(h.order.begin(), h.order.end(), 0);
  for (std::size_t c = 0; 2 * c + 1 < h.clusters(); ++c) {
    Eigen::AlignedBox3d box;
    for (std::size_t p = h.begin(c); p < h.end(c); ++p) box.extend(positions[at(h.order[p])]);
    int axis = 0;
    box.sizes().maxCoeff(&axis);
    const auto first = h.order.begin();
    std::nth_element(first + static_cast<std::ptrdiff_t>(h.begin(c)),
                     first + static_cast<std::ptrdiff_t>(h.end(2 * c + 1)),
                     first + static_cast<std::ptrdiff_t>(h.end(c)), [&](Index a, Index b) {
                       return std::pair(positions[at(a)][axis], a) < std::pair(positions[at(b)][axis], b);
                     });
  }
}

std::vector<Ball> balls(const Hierarchical& h, std::span<const Vec3> positions) {
  std::vector<Ball> out(h.clusters());
  for (std::size_t c = 0; c < out.size(); ++c) {
    Eigen::AlignedBox3d box;
    for (std::size_t p = h.begin(c); p < h.end(c); ++p) box.extend(positions[at(h.order[p])]);
    if (box.isEmpty()) continue;
    out[c].center = box.center();
    for (std::size_t p = h.begin(c); p < h.end(c); ++p)
      out[c].radius = std::max(out[c].radius, (positions[at(h.order[p])] - out[c].center).norm());
  }
  return out;
}

void find_blocks(Hierarchical& h, const std::vector<Ball>& ball, std::size_t r, std::size_t c) {
  if (far(ball[r], ball[c])) {
    h.blocks.push_back({static_cast<Index>(r), static_cast<Index>(c), false, 0});
  } else if (h.leaf(r)) {
    h.blocks.push_back({static_cast<Index>(r), static_cast<Index>(c), true, 0});
  } else {
    find_blocks(h, ball, 2 * r + 1, 2 * c + 1);
    find_blocks(h, ball, 2 * r + 2, 2 * c + 1);
    find_blocks(h, ball, 2 * r + 2, 2 * c + 2);
    if (r != c) find_blocks(h, ball, 2 * r + 1, 2 * c + 2);
  }
}

struct Builder {
  const Factored<float>& y;
  Hierarchical& h;
  int threads;
  const Progress& progress;
  std::size_t probes;  // columns of the sketches
  double cut;          // of the bases
  Sketches sketches{y, h, threads};
  std::vector<std::vector<Index>> far_of = std::vector<std::vector<Index>>(h.clusters());
  // Leaves' matrices are most of the memory: made when they are wanted first, dropped when wanted last.
  struct Wanted {
    std::once_flag made;
    std::atomic<std::size_t> left{0};
  };
  std::vector<Wanted> sketches_wanted = std::vector<Wanted>(h.clusters());
  std::vector<Wanted> seen_wanted = std::vector<Wanted>(h.clusters());
  std::vector<PathMatrix> seen = std::vector<PathMatrix>(h.clusters());  // Y times the basis
  std::vector<std::vector<float>> basis =
      std::vector<std::vector<float>>(h.clusters());  // or transfers, stacked

  void prepare() {
    for (const auto& b : h.blocks) {
      if (b.near) continue;
      far_of[at(b.row)].push_back(b.column);
      far_of[at(b.column)].push_back(b.row);
    }
    for (std::size_t c = 0; c < far_of.size(); ++c)
      sketches_wanted[c].left = seen_wanted[c].left = far_of[c].size();
    sketches.make(seed, probes, false, progress);
  }

  // The leading left singular vectors of a (m x probes) that leave less than `cut`: m x rank, column-major.
  std::vector<float> leading(const std::vector<float>& a, std::size_t m) const {
    if (m == 0) return {};
    const auto rows_of_a = static_cast<Eigen::Index>(m), n = static_cast<Eigen::Index>(probes);
    const Eigen::MatrixXd x = Eigen::Map<const Eigen::MatrixXf>(a.data(), rows_of_a, n).cast<double>();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(x * x.transpose());
    double tail = 0;
    Eigen::Index dropped = 0;
    for (; dropped < rows_of_a; ++dropped) {
      tail += std::max(0.0, eigen.eigenvalues()[dropped]);
      if (tail > cut * cut * static_cast<double>(probes)) break;
    }
    const Eigen::MatrixXf kept = eigen.eigenvectors().rightCols(rows_of_a - dropped).cast<float>();
    return {kept.data(), kept.data() + kept.size()};
  }

  const PathMatrix& sketch(std::size_t c) {
    if (h.leaf(c)) std::call_once(sketches_wanted[c].made, [&] { sketches.make_leaf(seed, probes, c); });
    return sketches.of(c);
  }
  const PathMatrix& seen_by(std::size_t c) {
    if (h.leaf(c))
      std::call_once(seen_wanted[c].made,
                     [&] { seen[c] = times(sketches.columns(c), basis[c].data(), h.width(c)); });
    return seen[c];
  }

  // Finds the bases of a subtree. `above`: the weighted sketch of the parent's far field.
  bool descend(std::size_t c, const PathMatrix* above) {
    PathMatrix field(sketches.rows(c), probes);
    if (above) add(*above, 1, field);
    for (const Index other : far_of[c]) {
      const double weight = 1 / std::sqrt(sketches.norm(c) * sketches.norm(at(other)));
      add(sketch(at(other)), static_cast<float>(weight), field);
      if (--sketches_wanted[at(other)].left == 0) sketches.drop(at(other));
    }
    if (h.leaf(c)) {
      const PathMatrix own = sketches.columns(c);
      std::vector<float> a(own.columns * probes);
      multiply_paths(own, field, probes, a.data(), own.columns);
      if (!set_basis(c, leading(a, own.columns), own.columns)) return false;
      seen[c] = times(own, basis[c].data(), h.width(c));
      return true;
    }
    const std::size_t left = 2 * c + 1, right = left + 1;
    if (!descend(left, &field) || !descend(right, &field)) return false;
    const std::size_t k = h.width(left), m = k + h.width(right);
    std::vector<float> a(m * probes);
    if (m > 0) {
      multiply_paths(seen[left], field, probes, a.data(), m);
      multiply_paths(seen[right], field, probes, a.data() + k, m);
    }
    if (!set_basis(c, leading(a, m), m)) return false;
    seen[c] = PathMatrix(sketches.rows(c), h.width(c));
    for (const std::size_t child : {left, right}) {
      const std::size_t width = h.width(child);
      std::vector<float> part(width * h.width(c));
      for (std::size_t j = 0; j < h.width(c); ++j)
        std::copy_n(basis[c].data() + j * m + (child == left ? 0 : k), width, part.data() + j * width);
      add(times(seen[child], part.data(), h.width(c)), 1, seen[c]);
      if (h.leaf(child)) seen[child] = {};
    }
    return true;
  }

  // False: the sketch is too thin to tell the rank.
  bool set_basis(std::size_t c, std::vector<float> values, std::size_t m) {
    const std::size_t width = m > 0 ? values.size() / m : 0;
    h.rank[c] = static_cast<Index>(width);
    basis[c] = std::move(values);
    return width == m || width + 8 <= probes;
  }

  bool find_bases() {
    std::vector<std::uint8_t> good(h.clusters(), 1);
    sketches.each(sketches.top(), [&](std::size_t c) { good[c] = descend(c, nullptr); });
    return std::all_of(good.begin(), good.end(), [](std::uint8_t g) { return g != 0; });
  }

  void fill() {
    h.values = HugeArray<float>(h.arrange());
    for (std::size_t c = 0; c < h.clusters(); ++c) {
      if (h.leaf(c)) {
        std::copy(basis[c].begin(), basis[c].end(), h.values.data() + h.basis[c]);
        continue;
      }
      const std::size_t left = 2 * c + 1, m = h.width(left) + h.width(left + 1);
      for (std::size_t j = 0; j < h.width(c); ++j)
        for (const std::size_t child : {left, left + 1})
          std::copy_n(basis[c].data() + j * m + (child == left ? 0 : h.width(left)), h.width(child),
                      h.values.data() + h.transfer[child] + j * h.width(child));
    }
    std::vector<std::size_t> begin{0};  // blocks of one row together: its leaf's columns of Y are made once
    for (std::size_t b = 1; b <= h.blocks.size(); ++b)
      if (b == h.blocks.size() || h.blocks[b].row != h.blocks[b - 1].row) begin.push_back(b);
    parallel_for(begin.size() - 1, 1, threads, [&](std::size_t i, std::size_t) {
      PathMatrix own;
      for (std::size_t b = begin[i]; b < begin[i + 1]; ++b) fill_block(h.blocks[b], own);
      stop_if_asked(progress);
    });
  }

  void fill_block(const Hierarchical::Block& b, PathMatrix& own) {
    const std::size_t r = at(b.row), c = at(b.column);
    float* out = h.values.data() + b.values;
    if (!b.near) {
      multiply_paths(seen_by(r), seen_by(c), h.width(c), out, h.width(r));
      for (const std::size_t cluster : {r, c})
        if (--seen_wanted[cluster].left == 0) seen[cluster] = {};
      return;
    }
    if (!own.rows) own = sketches.columns(r);
    const PathMatrix other = sketches.columns(c);
    multiply_paths(own, other, other.columns, out, own.columns);
  }
};

Hierarchical outline(std::size_t nodes, std::span<const Vec3> positions) {
  Hierarchical h;
  h.nodes = nodes;
  while (nodes > leaf_nodes << h.levels) ++h.levels;
  order_nodes(h, positions);
  find_blocks(h, balls(h, positions), 0, 0);
  std::sort(h.blocks.begin(), h.blocks.end(), [](const auto& a, const auto& b) {
    return std::pair(a.row, a.column) < std::pair(b.row, b.column);
  });
  h.rank.assign(h.clusters(), 0);
  return h;
}

}  // namespace

std::size_t Hierarchical::arrange() {
  std::size_t total = 0;
  const auto take = [&](std::size_t size) { return std::exchange(total, total + size); };
  basis.assign(clusters(), 0), transfer.assign(clusters(), 0);
  for (std::size_t c = 0; c < clusters(); ++c) {
    if (leaf(c)) basis[c] = take(unknowns(c) * width(c));
    if (c > 0) transfer[c] = take(width(c) * width((c - 1) / 2));
  }
  for (Block& b : blocks)
    b.values =
        take(b.near ? unknowns(at(b.row)) * unknowns(at(b.column)) : width(at(b.row)) * width(at(b.column)));
  return total;
}

Hierarchical compress(const Factored<float>& factored, std::span<const Vec3> positions, double tolerance,
                      int threads, const Progress& progress) {
  if (!(tolerance >= smallest_tolerance && tolerance < 1))
    throw Error(ErrorKind::usage, "a tolerance of {} is out of range: {} to 1; for exact ones use factored",
                tolerance, smallest_tolerance);
  if (positions.size() != factored.load_at.size())
    throw Error(ErrorKind::internal, "{} positions for {} loads", positions.size(), factored.load_at.size());
  // What the certificate finds in the worst block is some six times what is cut off.
  double cut = tolerance / 6;
  std::size_t probes = 80;
  for (int attempt = 0; attempt < 8; ++attempt) {
    const auto report = [&](double f) { progress.at(1 - std::pow(0.3, attempt + f)); };
    report(0);
    Hierarchical h = outline(positions.size(), positions);
    {
      Builder builder{factored, h, threads, progress, probes, cut};
      builder.prepare();
      report(0.3);
      if (!builder.find_bases()) {
        probes *= 2;
        continue;
      }
      builder.fill();
    }
    report(0.6);
    h.tolerance = tolerance;
    const std::vector<double> errors = block_errors(h, factored, threads, progress);
    h.error = *std::max_element(errors.begin(), errors.end());
    if (h.error <= tolerance) {
      HierarchicalCompliance whole(std::move(h));
      const double lowest = lowest_eigenvalue(whole);
      h = std::move(whole).release();
      h.lowest = lowest;
      if (lowest > 0) return h;
      cut /= 4;
    } else {
      cut *= std::min(0.5, 0.7 * tolerance / h.error);
    }
  }
  throw Error(ErrorKind::physics,
              "no hierarchical compliance keeps to a tolerance of {} and is positive definite; use a larger "
              "one, or the dense or factored storage",
              tolerance);
}

}  // namespace palpate
