// Building: clusters, sketches of their far fields, nested bases, couplings.
#include "palpate/compliance/hierarchical.hpp"

#include <Eigen/Eigenvalues>
#include <atomic>
#include <cmath>
#include <mutex>
#include <random>

#include "palpate/base/error.hpp"
#include "palpate/compliance/cholesky_impl.hpp"
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

// Sketches of this many levels, the lowest, are made when they are wanted first and dropped when wanted last:
// the walk down the tree is local. It costs a pass over Y for each level, and saves most of the memory.
constexpr int levels_on_demand = 3;

struct Builder {
  const Factored<float>& y;
  Hierarchical& h;
  int threads;
  const Progress& progress;
  std::size_t probes;  // columns of the sketches
  double cut;          // of the bases
  Sketches sketches{y, h, threads};
  int lowest = h.levels - levels_on_demand;  // level down to which sketches are kept
  struct Cluster {
    std::once_flag sketched;
    std::atomic<std::size_t> sketch_left{0}, seen_left{0}, own_left{0};  // uses to come
    std::vector<std::size_t> blocks;
    PathMatrix seen, own;      // Y times the basis; Y of a leaf
    std::vector<float> basis;  // or transfers, stacked
  };
  std::vector<Cluster> clusters = std::vector<Cluster>(h.clusters());
  struct Made {
    std::atomic<int> sides{0};  // of its two clusters that are ready
    std::vector<float> values;
  };
  std::vector<Made> made = std::vector<Made>(h.blocks.size());
  SharedProgress done{progress, 4.0 * static_cast<double>(std::size_t{1} << h.levels)};

  void count_uses() {
    for (std::size_t i = 0; i < h.blocks.size(); ++i) {
      const auto& b = h.blocks[i];
      for (const Index side : {b.row, b.column}) {
        Cluster& c = clusters[at(side)];
        ++(b.near ? c.own_left : c.seen_left);
        if (!b.near) ++c.sketch_left;
        if (c.blocks.empty() || c.blocks.back() != i) c.blocks.push_back(i);
      }
    }
    for (std::size_t c = 0; c < clusters.size(); ++c)
      clusters[c].seen_left += Hierarchical::level(c) > sketches.top();  // for its parent's
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
    if (Hierarchical::level(c) > lowest)
      std::call_once(clusters[c].sketched, [&] { sketches.make_one(seed, probes, c); });
    return sketches.of(c);
  }

  // The weighted sketch of all that is far from the cluster or from one above it.
  PathMatrix field_of(std::size_t c, const PathMatrix* above) {
    PathMatrix field(sketches.rows(c), probes);
    if (above) add(*above, 1, field);
    for (const Index other : sketches.far_of(c)) {
      const double weight = 1 / std::sqrt(sketches.norm(c) * sketches.norm(at(other)));
      add(sketch(at(other)), static_cast<float>(weight), field);
      if (--clusters[at(other)].sketch_left == 0) sketches.drop(at(other));
    }
    return field;
  }

  // Finds the bases of a subtree, and makes the blocks whose other cluster has its basis already.
  bool descend(std::size_t c, const PathMatrix* above) {
    const PathMatrix field = field_of(c, above);
    Cluster& cluster = clusters[c];
    if (h.leaf(c)) {
      cluster.own = sketches.columns(c);
      const std::size_t m = cluster.own.columns;
      std::vector<float> a(m * probes);
      multiply_paths(cluster.own, field, probes, a.data(), m);
      if (!set_basis(c, leading(a, m), m)) return false;
      cluster.seen = times(cluster.own, cluster.basis.data(), h.width(c));
      done.add(3);
    } else {
      const std::size_t left = 2 * c + 1, right = left + 1;
      if (!descend(left, &field) || !descend(right, &field)) return false;
      const std::size_t k = h.width(left), m = k + h.width(right);
      std::vector<float> a(m * probes);
      if (m > 0) {
        multiply_paths(clusters[left].seen, field, probes, a.data(), m);
        multiply_paths(clusters[right].seen, field, probes, a.data() + k, m);
      }
      if (!set_basis(c, leading(a, m), m)) return false;
      cluster.seen = PathMatrix(sketches.rows(c), h.width(c));
      for (const std::size_t child : {left, right}) {
        const std::vector<float> part = transfer(child);
        add(times(clusters[child].seen, part.data(), h.width(c)), 1, cluster.seen);
        used(clusters[child].seen_left, clusters[child].seen);
      }
    }
    for (const std::size_t b : cluster.blocks) arrive(b);
    return true;
  }

  // descend() without numbers, as far as memory goes: what it takes, and gives back, in floats. h has the
  // ranks.
  void rehearse(std::size_t c, StackNeed& need) {
    const auto size = [&](std::size_t k, std::size_t columns) { return sketches.rows(k).size * columns; };
    const auto use = [&](std::atomic<std::size_t>& left, std::size_t floats) {
      if (--left == 0) need.pop(floats);
    };
    need.push(size(c, probes));  // the field
    for (const Index other : sketches.far_of(c)) {
      const std::size_t o = at(other);
      if (Hierarchical::level(o) > lowest)
        std::call_once(clusters[o].sketched, [&] { need.push(size(o, probes)); });
      use(clusters[o].sketch_left, size(o, probes));
    }
    if (!h.leaf(c)) rehearse(2 * c + 1, need), rehearse(2 * c + 2, need);
    need.push(size(c, h.width(c)));
    if (h.leaf(c))
      need.push(size(c, h.unknowns(c)));
    else
      for (const std::size_t child : {2 * c + 1, 2 * c + 2})
        use(clusters[child].seen_left, size(child, h.width(child)));
    for (const std::size_t block : clusters[c].blocks) {
      const auto& b = h.blocks[block];
      if (++made[block].sides < 2 && b.row != b.column) continue;
      for (const std::size_t side : {at(b.row), at(b.column)})
        b.near ? use(clusters[side].own_left, size(side, h.unknowns(side)))
               : use(clusters[side].seen_left, size(side, h.width(side)));
    }
    need.pop(size(c, probes));
  }

  // False: the sketch is too thin to tell the rank.
  bool set_basis(std::size_t c, std::vector<float> values, std::size_t m) {
    const std::size_t width = m > 0 ? values.size() / m : 0;
    h.rank[c] = static_cast<Index>(width);
    clusters[c].basis = std::move(values);
    return width == m || width + 8 <= probes;
  }

  // A cluster's rows of its parent's basis.
  std::vector<float> transfer(std::size_t c) const {
    const std::size_t parent = (c - 1) / 2, left = 2 * parent + 1, width = h.width(c);
    const std::size_t m = h.width(left) + h.width(left + 1), skip = c == left ? 0 : h.width(left);
    std::vector<float> part(width * h.width(parent));
    for (std::size_t j = 0; j < h.width(parent); ++j)
      std::copy_n(clusters[parent].basis.data() + j * m + skip, width, part.data() + j * width);
    return part;
  }

  static void used(std::atomic<std::size_t>& left, PathMatrix& matrix) {
    if (--left == 0) matrix = {};
  }

  // One of a block's clusters is ready. The second makes the block.
  void arrive(std::size_t block) {
    const auto& b = h.blocks[block];
    if (++made[block].sides < 2 && b.row != b.column) return;
    Cluster &r = clusters[at(b.row)], &c = clusters[at(b.column)];
    const PathMatrix &x = b.near ? r.own : r.seen, &z = b.near ? c.own : c.seen;
    made[block].values.resize(x.columns * z.columns);
    multiply_paths(x, z, z.columns, made[block].values.data(), x.columns);
    for (Cluster* side : {&r, &c})
      b.near ? used(side->own_left, side->own) : used(side->seen_left, side->seen);
  }

  bool find_bases() {
    count_uses();
    sketches.make(seed, probes, lowest, done);
    std::vector<std::uint8_t> good(h.clusters(), 1);
    sketches.each(sketches.top(), [&](std::size_t c) { good[c] = descend(c, nullptr); });
    return std::all_of(good.begin(), good.end(), [](std::uint8_t g) { return g != 0; });
  }

  void fill() {
    h.values = HugeArray<float>(h.arrange());
    const auto put = [&](std::vector<float> values, std::size_t offset) {
      std::copy(values.begin(), values.end(), h.values.data() + offset);
    };
    for (std::size_t c = 0; c < h.clusters(); ++c) {
      if (h.leaf(c)) put(std::move(clusters[c].basis), h.basis[c]);
      if (c > 0) put(transfer(c), h.transfer[c]);
    }
    for (std::size_t b = 0; b < made.size(); ++b) put(std::move(made[b].values), h.blocks[b].values);
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

std::size_t first_probes(double tolerance) { return tolerance < 3e-4 ? 160 : 80; }

}  // namespace

std::size_t compress_bytes(const Factored<float>& outline_of_y, std::span<const Vec3> positions,
                           double tolerance, int threads) {
  Hierarchical h = outline(positions.size(), positions);
  const std::size_t probes = first_probes(tolerance);
  // As measured, a rank of 17 for each digit; less in the few large clusters.
  const auto rank = static_cast<std::size_t>(17 * -std::log10(tolerance));
  for (std::size_t c = 0; c < h.clusters(); ++c)
    h.rank[c] = static_cast<Index>(std::min({rank, h.unknowns(c), probes}));
  const Progress quiet;
  Builder builder{outline_of_y, h, threads, quiet, probes, 0};
  const Sketches& sketches = builder.sketches;
  for (std::size_t c = 0; c < h.clusters(); ++c)
    if (Hierarchical::level(c) < sketches.top()) h.rank[c] = 0;
  const std::size_t values = h.arrange();
  builder.count_uses();
  StackNeed need;
  std::size_t certificate = 0;
  for (std::size_t c = 0; c < h.clusters(); ++c) {
    certificate += sketches.rows(c).size * certificate_probes;
    if (Hierarchical::level(c) <= builder.lowest) need.push(sketches.rows(c).size * probes);
  }
  for (std::size_t c = 0; c < h.clusters(); ++c)
    if (Hierarchical::level(c) == sketches.top()) builder.rehearse(c, need);
  // Each thread is at another place of the tree, with its own neighbourhood; and has some work space.
  const int workers = std::clamp(threads == 0 ? default_threads() : threads, 1, 8);
  const auto build = static_cast<std::size_t>((0.9 + 0.15 * workers) * static_cast<double>(need.most()));
  const std::size_t work = std::size_t{20'000'000} * static_cast<std::size_t>(workers);
  return work + sizeof(float) * (values + std::max(build, certificate)) * 11 / 10;
}

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
  double share = 1;
  std::size_t probes = first_probes(tolerance);
  for (int attempt = 0; attempt < 8; ++attempt) {
    const auto part = [&](double from, double to) {  // of this attempt; what is left is for others
      Progress out{nullptr, progress.interrupted};
      if (progress.report)
        out.report = [=, &progress](double f) {
          progress.report(1 - std::pow(0.1, attempt + from + f * (to - from)));
        };
      return out;
    };
    Hierarchical h = outline(positions.size(), positions);
    // What the certificate finds in the worst block is so many times what is cut off, as measured: the more
    // blocks, the worse the worst.
    const double cut = share * tolerance / std::max(6, h.levels - 2);
    {
      const Progress building = part(0, 0.7);
      Builder builder{factored, h, threads, building, probes, cut};
      if (!builder.find_bases()) {
        probes *= 2;
        continue;
      }
      builder.fill();
    }
    h.tolerance = tolerance;
    const std::vector<double> errors = block_errors(h, factored, threads, part(0.7, 0.95));
    h.error = *std::max_element(errors.begin(), errors.end());
    if (h.error <= tolerance) {
      HierarchicalCompliance whole(std::move(h));
      const double lowest = lowest_eigenvalue(whole);
      h = std::move(whole).release();
      h.lowest = lowest;
      if (lowest > 0) return h;
      share /= 4;
    } else {
      share *= std::min(0.7, 0.8 * tolerance / h.error);
    }
  }
  throw Error(ErrorKind::physics,
              "no hierarchical compliance keeps to a tolerance of {} and is positive definite; use a larger "
              "one, or the dense or factored storage",
              tolerance);
}

}  // namespace palpate
