// T 5.1.3, eq. 5.5: the matrix covers all surface points; anchored ones have the identity on their diagonal
// and zero elsewhere.
#include "palpate/simulation/handover.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "palpate/base/hash.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate {

namespace {

// Which triangles have the directed edge a -> b.
struct Edge {
  Index a, b, opposite;
  std::size_t triangle;
  bool operator<(const Edge& e) const { return std::pair(a, b) < std::pair(e.a, e.b); }
};

class StripMaker {
 public:
  explicit StripMaker(const std::vector<Triangle>& triangles) : used_(triangles.size(), 0) {
    for (std::size_t t = 0; t < triangles.size(); ++t)
      for (std::size_t k = 0; k < 3; ++k)
        edges_.push_back({triangles[t][k], triangles[t][(k + 1) % 3], triangles[t][(k + 2) % 3], t});
    std::stable_sort(edges_.begin(), edges_.end());
  }

  // The strip that begins with t's corners in this order; its triangles are returned in `taken`.
  std::vector<Index> grow(std::size_t t, const Triangle& corners, std::vector<std::size_t>& taken) {
    std::vector<Index> strip(corners.begin(), corners.end());
    taken.assign(1, t);
    used_[t] = 1;
    for (;;) {
      Index a = strip[strip.size() - 2], b = strip[strip.size() - 1];
      if (taken.size() % 2 == 1) std::swap(a, b);
      auto edge = std::lower_bound(edges_.begin(), edges_.end(), Edge{a, b, 0, 0});
      while (edge != edges_.end() && edge->a == a && edge->b == b && used_[edge->triangle]) ++edge;
      if (edge == edges_.end() || edge->a != a || edge->b != b) break;
      strip.push_back(edge->opposite);
      taken.push_back(edge->triangle);
      used_[edge->triangle] = 1;
    }
    for (const std::size_t i : taken) used_[i] = 0;
    return strip;
  }
  void use(const std::vector<std::size_t>& taken) {
    for (const std::size_t i : taken) used_[i] = 1;
  }
  bool used(std::size_t t) const { return used_[t]; }

 private:
  std::vector<Edge> edges_;
  std::vector<char> used_;
};

}  // namespace

std::vector<std::vector<Index>> make_strips(const std::vector<Triangle>& triangles) {
  StripMaker maker(triangles);
  std::vector<std::vector<Index>> strips;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (maker.used(t)) continue;
    std::vector<Index> best;
    std::vector<std::size_t> taken, best_taken;
    for (std::size_t k = 0; k < 3; ++k) {
      const Triangle& c = triangles[t];
      std::vector<Index> strip = maker.grow(t, {c[k], c[(k + 1) % 3], c[(k + 2) % 3]}, taken);
      if (strip.size() > best.size()) best = std::move(strip), best_taken = taken;
    }
    maker.use(best_taken);
    strips.push_back(std::move(best));
  }
  return strips;
}

std::vector<Triangle> strip_triangles(const std::vector<Index>& strip) {
  std::vector<Triangle> triangles;
  for (std::size_t i = 0; i + 2 < strip.size(); ++i)
    triangles.push_back({strip[i + i % 2], strip[i + 1 - i % 2], strip[i + 2]});
  return triangles;
}

namespace {

class HandoverWriter {
 public:
  HandoverWriter(const std::filesystem::path& path, const Organ& organ, const Progress& progress)
      : organ_(organ), progress_(progress), file_(path) {}

  void write() {
    add("{} {} 1 {}", organ_.surface_size(), organ_.surface.triangles.size(), organ_.materials.size());
    for (const Material& m : organ_.materials) add(" {} {} {}", m.young, m.poisson, m.density);
    add("\n");
    matrix();
    for (const Index row : organ_.row_of) add("{} ", row < 0 ? 1 : 0);
    add("\n");
    const std::vector<Vec3> normals = vertex_normals(organ_.surface);
    for (std::size_t i = 0; i < organ_.surface_size(); ++i) {
      const Vec3 &p = organ_.surface.vertices[i], &n = normals[i];
      add("{} {} {} {} {} {}\n", p.x(), p.y(), p.z(), n.x(), n.y(), n.z());
    }
    strips();
    for (std::size_t i = 0; i < organ_.surface_size(); ++i) add("1 ");
    add("\n");
    colours();
    flush();
    file_.commit();
  }

 private:
  template <class... Args>
  void add(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(buffer_), format, std::forward<Args>(args)...);
    if (buffer_.size() > 1 << 20) flush();
  }
  void flush() {
    file_.write({buffer_.data(), buffer_.size()});
    buffer_.clear();
  }

  void matrix() {
    const std::size_t s = organ_.surface_size();
    std::vector<float> c(3 * organ_.compliance.nodes());
    for (std::size_t i = 0; i < 3 * s; ++i) {
      const Index row = organ_.row_of[i / 3];
      if (row >= 0) organ_.compliance.row(3 * static_cast<std::size_t>(row) + i % 3, c);
      for (std::size_t j = 0; j < 3 * s; ++j) {
        const Index column = organ_.row_of[j / 3];
        if (row < 0 || column < 0)
          add("{} ", i == j ? 1 : 0);
        else
          add("{} ", c[3 * static_cast<std::size_t>(column) + j % 3]);
      }
      progress_.at(static_cast<double>(i + 1) / static_cast<double>(3 * s));
    }
    add("\n");
  }

  void strips() {
    const std::vector<std::vector<Index>> strips = make_strips(organ_.surface.triangles);
    std::size_t entries = 0;
    add("{}\n", strips.size());
    for (const auto& strip : strips) add("{} ", strip.size()), entries += strip.size();
    add("\n{}\n", entries);
    for (const auto& strip : strips)
      for (const Index v : strip) add("{} ", v);
    add("\n");
  }

  // How far a point gives way to a unit force: blue where it does not, red where it does most.
  void colours() {
    std::vector<double> softness;
    for (const Index row : organ_.row_of) {
      std::array<float, 9> own{};
      if (row >= 0) organ_.compliance.block({&row, 1}, own, 3);
      softness.push_back(static_cast<double>(own[0] + own[4] + own[8]));
    }
    const double most = *std::max_element(softness.begin(), softness.end());
    for (const double c : softness) {
      const double x = most > 0 ? c / most : 0;
      add("{:.3f} {:.3f} {:.3f}\n", x, 1 - std::abs(2 * x - 1), 1 - x);
    }
  }

  const Organ& organ_;
  const Progress& progress_;
  AtomicFile file_;
  fmt::memory_buffer buffer_;
};

class HandoverReader {
 public:
  HandoverReader(const std::string& file, const std::string& bytes, const Progress& progress)
      : file_(file), in_(file, bytes), progress_(progress) {
    Hash hash;
    hash.add_bytes(bytes.data(), bytes.size());
    organ_.hash = hash.value();
  }

  Organ read() {
    header();
    in_.at("matrix");
    in_.count(static_cast<std::int64_t>(9 * points_ * points_), 2);
    const std::size_t matrix_at = in_.position();
    for (std::size_t i = 0; i < 9 * points_ * points_; ++i) skip_word(i);
    flags();
    points();
    strips();
    for (std::size_t i = 0; i < points_; ++i) in_.at("surface flag", static_cast<std::int64_t>(i)), flag(1);
    for (std::size_t i = 0; i < 3 * points_; ++i)
      in_.at("colour", static_cast<std::int64_t>(i / 3)), in_.number();
    in_.at(nullptr);
    if (!in_.at_end()) in_.fail("holds more than was announced");
    in_.require_line_end();
    in_.move_to(matrix_at);
    matrix();
    set_readings(organ_);
    return std::move(organ_);
  }

 private:
  void header() {
    in_.at("header");
    const std::int64_t points = in_.integer(), triangles = in_.integer(), inverted = in_.integer();
    points_ = in_.count(points, 20), triangles_ = in_.count(triangles, 2);
    if (points_ < 3 || triangles_ < 1)
      in_.fail(fmt::format("{} points and {} triangles are no surface", points, triangles));
    if (points_ > 1000000) in_.fail(fmt::format("{} points are more than a dense matrix can have", points));
    if (inverted != 1) in_.fail("the matrix is not inverted (third number); only inverted ones are read");
    const std::size_t materials = in_.count(in_.integer(), 6);
    for (std::size_t i = 0; i < materials; ++i) {
      const double young = in_.number(), poisson = in_.number(), density = in_.number();
      organ_.materials.push_back({young, poisson, density});
      organ_.mesh.region_names.push_back(materials == 1 ? "tissue" : fmt::format("region {}", i + 1));
      require_valid(organ_.materials.back(), fmt::format("{}: material {}", file_, i + 1));
    }
  }

  void skip_word(std::size_t i) {
    in_.word();
    if (i % 1000000 == 0)
      progress_.at(0.3 * static_cast<double>(i) / static_cast<double>(9 * points_ * points_));
  }

  std::int64_t flag(std::int64_t largest) {
    const std::int64_t value = in_.integer();
    if (value < 0 || value > largest) in_.fail(fmt::format("a flag is {}", value));
    return value;
  }

  void flags() {
    for (std::size_t i = 0; i < points_; ++i) {
      in_.at("interaction flag", static_cast<std::int64_t>(i));
      const bool anchored = flag(1 << 20) != 0;  // the thesis numbers the interaction elements
      organ_.row_of.push_back(anchored ? -1 : static_cast<Index>(organ_.node_of_row.size()));
      if (!anchored) organ_.node_of_row.push_back(static_cast<Index>(i));
    }
    if (organ_.node_of_row.empty()) in_.fail("all points are anchored; nothing can move");
  }

  void points() {
    for (std::size_t i = 0; i < points_; ++i) {
      in_.at("point", static_cast<std::int64_t>(i));
      const double x = in_.number(), y = in_.number(), z = in_.number();
      organ_.surface.vertices.push_back({x, y, z});
      for (int k = 0; k < 3; ++k) in_.number();  // normal
    }
  }

  void strips() {
    in_.at("strips");
    std::vector<std::size_t> lengths(in_.count(in_.integer(), 2));
    std::size_t sum = 0;
    for (std::size_t& length : lengths) {
      length = in_.count(in_.integer(), 2);
      if (length < 3) in_.fail(fmt::format("a strip of {} points", length));
      sum += length;
    }
    const std::int64_t entries = in_.integer();
    if (entries != static_cast<std::int64_t>(sum))
      in_.fail(fmt::format("{} entries, but the lengths sum to {}", entries, sum));
    in_.count(entries, 2);
    for (const std::size_t length : lengths) {
      std::vector<Index> strip(length);
      for (Index& v : strip) {
        const std::int64_t entry = in_.integer();
        if (entry < 0 || static_cast<std::uint64_t>(entry) >= points_)
          in_.fail(fmt::format("point {} of {}", entry, points_));
        v = static_cast<Index>(entry);
      }
      const std::vector<Triangle> more = strip_triangles(strip);
      organ_.surface.triangles.insert(organ_.surface.triangles.end(), more.begin(), more.end());
    }
    if (organ_.surface.triangles.size() != triangles_)
      in_.fail(
          fmt::format("the strips hold {} triangles, not {}", organ_.surface.triangles.size(), triangles_));
  }

  // The free rows and columns. Decimals of a symmetric matrix may differ in the last digit: the mean is
  // taken.
  void matrix() {
    const std::size_t rows = organ_.node_of_row.size(), n = 3 * rows;
    if (n * n * sizeof(float) > available_bytes())
      throw Error(ErrorKind::resource, "the matrix of {} points needs {:.1f} GB, more than is free", rows,
                  static_cast<double>(n * n * sizeof(float)) * 1e-9);
    HugeArray<float> c(n * n);
    for (std::size_t i = 0; i < 3 * points_; ++i) {
      in_.at("matrix row", static_cast<std::int64_t>(i));
      const Index row = organ_.row_of[i / 3];
      for (std::size_t j = 0; j < 3 * points_; ++j) {
        const Index column = organ_.row_of[j / 3];
        const float value = in_.number<float>();
        if (row >= 0 && column >= 0)
          c[(3 * static_cast<std::size_t>(row) + i % 3) * n + 3 * static_cast<std::size_t>(column) + j % 3] =
              value;
        else if (value != (i == j ? 1.0f : 0.0f))
          in_.fail("the rows and columns of an anchored point are not those of the identity");
      }
      progress_.at(0.3 + 0.7 * static_cast<double>(i + 1) / static_cast<double>(3 * points_));
    }
    in_.at("matrix");
    for (std::size_t i = 0; i < n; ++i)
      if (!(c[i * (n + 1)] > 0))
        in_.fail(fmt::format("diagonal entry {} of the free points is not positive", i));
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < i; ++j) {
        float &a = c[i * n + j], &b = c[j * n + i];
        const float scale = std::sqrt(c[i * (n + 1)]) * std::sqrt(c[j * (n + 1)]);
        if (!(std::abs(a - b) <= 1e-3f * scale && std::abs(a) <= 1.001f * scale))
          in_.fail(fmt::format("is not symmetric and positive definite (free rows {} and {})", i, j));
        a = b = a == b ? a : 0.5f * (a + b);
      }
    organ_.compliance = Compliance::dense(std::move(c), rows);
  }

  const std::string& file_;
  Scanner in_;
  const Progress& progress_;
  Organ organ_;
  std::size_t points_ = 0, triangles_ = 0;
};

}  // namespace

void write_handover(const std::filesystem::path& path, const Organ& organ, const Progress& progress) {
  HandoverWriter(path, organ, progress).write();
}

Organ read_handover(const std::filesystem::path& path, const Progress& progress) {
  const std::string bytes = read_file(path);
  if (bytes.empty()) throw Error(ErrorKind::format, "{}: is empty", path.string());
  return HandoverReader(path.string(), bytes, progress).read();
}

}  // namespace palpate
