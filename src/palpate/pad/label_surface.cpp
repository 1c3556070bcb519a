#include "palpate/pad/label_surface.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {

constexpr double sigma = 0.7;  // voxels
constexpr int reach = 3;

// Part of the volume about the labels with an empty rim, as 0 and 1.
struct Cropped {
  std::array<std::int64_t, 3> from{}, size{};
  std::vector<float> value;  // first axis fastest
  std::size_t number(std::int64_t i, std::int64_t j, std::int64_t k) const {
    return static_cast<std::size_t>(i + size[0] * (j + size[1] * k));
  }
};

Cropped crop(const LabelVolume& volume, std::span<const std::int32_t> labels) {
  const auto wanted = [&](std::int32_t x) {
    return std::find(labels.begin(), labels.end(), x) != labels.end();
  };
  std::array<std::int64_t, 3> n, low, high;
  for (std::size_t a = 0; a < 3; ++a)
    n[a] = static_cast<std::int64_t>(volume.size[a]), low[a] = n[a], high[a] = -1;
  std::size_t at = 0;
  for (std::int64_t k = 0; k < n[2]; ++k)
    for (std::int64_t j = 0; j < n[1]; ++j)
      for (std::int64_t i = 0; i < n[0]; ++i)
        if (wanted(volume.labels[at++])) {
          const std::array<std::int64_t, 3> p{i, j, k};
          for (std::size_t a = 0; a < 3; ++a)
            low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
        }
  if (high[0] < 0) {
    std::string list;
    for (const std::int32_t l : labels) list += (list.empty() ? "" : ", ") + std::to_string(l);
    throw Error(ErrorKind::geometry, "no voxel has label {}; `palpate info` lists the labels there are",
                list);
  }
  Cropped out;
  for (std::size_t a = 0; a < 3; ++a)
    out.from[a] = low[a] - reach - 1, out.size[a] = high[a] - low[a] + 2 * reach + 3;
  out.value.assign(static_cast<std::size_t>(out.size[0] * out.size[1] * out.size[2]), 0);
  for (std::int64_t k = low[2]; k <= high[2]; ++k)
    for (std::int64_t j = low[1]; j <= high[1]; ++j)
      for (std::int64_t i = low[0]; i <= high[0]; ++i)
        if (wanted(volume.labels[static_cast<std::size_t>(i + n[0] * (j + n[1] * k))]))
          out.value[out.number(i - out.from[0], j - out.from[1], k - out.from[2])] = 1;
  return out;
}

// Along one axis after the other; beyond the rim is nothing.
void smooth(Cropped& c) {
  std::array<float, 2 * reach + 1> weight;
  float sum = 0;
  for (int i = -reach; i <= reach; ++i)
    sum += weight[static_cast<std::size_t>(i + reach)] =
        static_cast<float>(std::exp(-0.5 * i * i / (sigma * sigma)));
  for (float& w : weight) w /= sum;
  const std::array<std::int64_t, 3> stride{1, c.size[0], c.size[0] * c.size[1]};
  std::vector<float> line;
  for (std::size_t a = 0; a < 3; ++a) {
    const std::size_t b = (a + 1) % 3, d = (a + 2) % 3;
    line.resize(static_cast<std::size_t>(c.size[a] + 2 * reach));
    for (std::int64_t j = 0; j < c.size[b]; ++j)
      for (std::int64_t k = 0; k < c.size[d]; ++k) {
        float* const first = c.value.data() + j * stride[b] + k * stride[d];
        for (std::int64_t i = 0; i < c.size[a]; ++i)
          line[static_cast<std::size_t>(i + reach)] = first[i * stride[a]];
        for (std::int64_t i = 0; i < c.size[a]; ++i) {
          float x = 0;
          for (std::size_t w = 0; w < weight.size(); ++w)
            x += weight[w] * line[static_cast<std::size_t>(i) + w];
          first[i * stride[a]] = x;
        }
      }
  }
}

// Each cube between eight voxels is six tetrahedra about its main diagonal, so that neighbours fit (Kuhn).
class Marching {
 public:
  Marching(const Cropped& volume) : volume_(volume) {}

  TriangleMesh run() {
    for (std::int64_t k = 0; k + 1 < volume_.size[2]; ++k)
      for (std::int64_t j = 0; j + 1 < volume_.size[1]; ++j)
        for (std::int64_t i = 0; i + 1 < volume_.size[0]; ++i) cube({i, j, k});
    return std::move(mesh_);
  }

 private:
  using Place = std::array<std::int64_t, 3>;
  float at(const Place& p) const { return volume_.value[volume_.number(p[0], p[1], p[2])]; }

  void cube(const Place& p) {
    int inside = 0;
    for (int c = 0; c < 8; ++c) inside += at({p[0] + (c & 1), p[1] + (c >> 1 & 1), p[2] + (c >> 2)}) >= 0.5f;
    if (inside == 0 || inside == 8) return;
    constexpr int order[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
    for (int o = 0; o < 6; ++o) {
      std::array<Place, 4> corner{p, p, p, p};
      for (std::size_t step = 0; step < 3; ++step) {
        corner[step + 1] = corner[step];
        ++corner[step + 1][static_cast<std::size_t>(order[o][step])];
      }
      tetrahedron(corner, o < 3);
    }
  }

  // even: (b - a) x (c - a) . (d - a) > 0
  void tetrahedron(std::array<Place, 4> t, bool even) {
    if (!even) std::swap(t[2], t[3]);
    std::array<std::size_t, 4> in, out;
    std::size_t ins = 0, outs = 0;
    for (std::size_t i = 0; i < 4; ++i) (at(t[i]) >= 0.5f ? in[ins++] : out[outs++]) = i;
    const auto cut = [&](std::size_t a, std::size_t b) { return vertex(t[a], t[b]); };
    const auto odd = [](std::size_t a, std::size_t b, std::size_t c, std::size_t d) {
      const std::array<std::size_t, 4> p{a, b, c, d};
      int swaps = 0;
      for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < i; ++j) swaps += p[j] > p[i];
      return swaps % 2 != 0;
    };
    const auto add = [&](Index a, Index b, Index c, bool turned) {
      mesh_.triangles.push_back(turned ? Triangle{a, c, b} : Triangle{a, b, c});
    };
    if (ins == 1)
      add(cut(in[0], out[0]), cut(in[0], out[1]), cut(in[0], out[2]), odd(in[0], out[0], out[1], out[2]));
    if (ins == 3)
      add(cut(in[0], out[0]), cut(in[1], out[0]), cut(in[2], out[0]), !odd(out[0], in[0], in[1], in[2]));
    if (ins == 2) {
      const Index a = cut(in[0], out[0]), b = cut(in[0], out[1]), c = cut(in[1], out[1]),
                  d = cut(in[1], out[0]);
      const bool turned = odd(in[0], in[1], out[0], out[1]);
      add(a, b, c, turned), add(a, c, d, turned);
    }
  }

  Index vertex(const Place& a, const Place& b) {
    const Place &low = std::min(a, b), &high = std::max(a, b);
    const auto direction =
        static_cast<std::size_t>((high[0] - low[0]) + 2 * (high[1] - low[1]) + 4 * (high[2] - low[2]));
    const auto [entry, fresh] = number_.emplace(8 * volume_.number(low[0], low[1], low[2]) + direction,
                                                static_cast<Index>(mesh_.vertices.size()));
    if (fresh) {
      const double x = static_cast<double>(at(low)), y = static_cast<double>(at(high));
      const double t = std::clamp((0.5 - x) / (y - x), 0.01, 0.99);  // no triangle without area
      Vec3 p;
      for (std::size_t k = 0; k < 3; ++k)
        p[static_cast<int>(k)] =
            static_cast<double>(volume_.from[k] + low[k]) + t * static_cast<double>(high[k] - low[k]);
      mesh_.vertices.push_back(p);
    }
    return entry->second;
  }

  const Cropped& volume_;
  TriangleMesh mesh_;
  std::unordered_map<std::size_t, Index> number_;
};

}  // namespace

TriangleMesh label_surface(const LabelVolume& volume, std::span<const std::int32_t> labels) {
  Cropped cropped = crop(volume, labels);
  smooth(cropped);
  TriangleMesh mesh = Marching(cropped).run();
  if (mesh.triangles.empty())
    throw Error(ErrorKind::geometry, "the labelled voxels are too few or too thin for a surface around them");
  for (Vec3& p : mesh.vertices) p = volume.to_world * Eigen::Vector4d(p.x(), p.y(), p.z(), 1);
  if (volume.to_world.leftCols<3>().determinant() < 0)
    for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

}  // namespace palpate
