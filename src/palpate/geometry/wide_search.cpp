#include <algorithm>
#include <cmath>

#include "palpate/geometry/wide_tree.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#define PALPATE_AVX2 __attribute__((target("avx2,fma")))
#endif

namespace palpate {

namespace {

using Lanes = WideTree::Lanes;

inline void prefetch(const void* node) {
  static_assert(sizeof(WideTree::Boxes) == 576 && sizeof(WideTree::Triangles) == 576);
  for (int line = 0; line < 9; ++line) __builtin_prefetch(static_cast<const char*>(node) + 64 * line);
}

// Squared distances to all eight into `out`; the bits of those that are not above `limit`.
struct Portable {
  static unsigned near(const Lanes& distance2, float limit) {
    unsigned mask = 0;
    for (unsigned i = 0; i < 8; ++i) mask |= unsigned{!(distance2[i] > limit)} << i;
    return mask;
  }
  static unsigned boxes(const WideTree::Boxes& b, const float* p, float limit, Lanes& out) {
    out = {};
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t i = 0; i < 8; ++i) {
        const float x =
            b.axis[a][0][i] * p[0] + b.axis[a][1][i] * p[1] + b.axis[a][2][i] * p[2] - b.middle[a][i];
        const float beyond = std::abs(x) - b.half[a][i], positive = beyond > 0 ? beyond : 0;
        out[i] += positive * positive;
      }
    return near(out, limit) & b.lanes;
  }
  static float clamp(float x, float high) { return x < 0 ? 0 : x > high ? high : x; }
  static unsigned triangles(const WideTree::Triangles& t, const float* p, float limit, Lanes& out) {
    for (std::size_t i = 0; i < 8; ++i) {
      const float rx = p[0] - t.origin[0][i], ry = p[1] - t.origin[1][i], rz = p[2] - t.origin[2][i];
      const auto along = [&](std::size_t a) {
        return rx * t.axis[a][0][i] + ry * t.axis[a][1][i] + rz * t.axis[a][2][i];
      };
      const float x = along(0), y = along(1), h = along(2);
      const float x1 = t.x1[i], x2 = t.x2[i], y2 = t.y2[i], dx = x2 - x1, wx = x - x1;
      const float e01 = x - clamp(x, x1);
      const float s12 = clamp((wx * dx + y * y2) * t.inverse12[i], 1);
      const float s20 = clamp((x * x2 + y * y2) * t.inverse20[i], 1);
      const float ux = wx - s12 * dx, uy = y - s12 * y2, vx = x - s20 * x2, vy = y - s20 * y2;
      const float beside = std::min({e01 * e01 + y * y, ux * ux + uy * uy, vx * vx + vy * vy});
      const bool in = y >= 0 && dx * y - y2 * wx >= 0 && y2 * x - x2 * y >= 0;
      out[i] = h * h + (in ? 0 : beside);
    }
    return near(out, limit) & t.lanes;
  }
  static float smallest(const Lanes& x, unsigned mask) {
    float least = std::numeric_limits<float>::infinity();
    for (unsigned i = 0; i < 8; ++i)
      if (mask >> i & 1u) least = std::min(least, x[i]);
    return least;
  }
};

#if defined(__x86_64__)
struct Avx2 {
  PALPATE_AVX2 static inline __m256 load(const Lanes& x) { return _mm256_load_ps(x.data()); }
  PALPATE_AVX2 static inline unsigned near(__m256 distance2, float limit, Lanes& out) {
    _mm256_store_ps(out.data(), distance2);
    const __m256 mask = _mm256_cmp_ps(distance2, _mm256_set1_ps(limit), _CMP_NGT_UQ);
    return static_cast<unsigned>(_mm256_movemask_ps(mask));
  }
  PALPATE_AVX2 static inline __m256 dot(const std::array<Lanes, 3>& n, __m256 x, __m256 y, __m256 z) {
    return _mm256_fmadd_ps(load(n[2]), z, _mm256_fmadd_ps(load(n[1]), y, _mm256_mul_ps(load(n[0]), x)));
  }
  PALPATE_AVX2 static inline unsigned boxes(const WideTree::Boxes& b, const float* p, float limit,
                                            Lanes& out) {
    const __m256 x = _mm256_broadcast_ss(p), y = _mm256_broadcast_ss(p + 1), z = _mm256_broadcast_ss(p + 2);
    const __m256 sign = _mm256_set1_ps(-0.0f);
    __m256 sum = _mm256_setzero_ps();
    for (std::size_t a = 0; a < 3; ++a) {
      __m256 v = _mm256_sub_ps(dot(b.axis[a], x, y, z), load(b.middle[a]));
      v = _mm256_sub_ps(_mm256_andnot_ps(sign, v), load(b.half[a]));
      v = _mm256_max_ps(v, _mm256_setzero_ps());
      sum = _mm256_fmadd_ps(v, v, sum);
    }
    return near(sum, limit, out) & b.lanes;
  }
  PALPATE_AVX2 static inline __m256 clamp(__m256 x, __m256 high) {
    return _mm256_min_ps(_mm256_max_ps(x, _mm256_setzero_ps()), high);
  }
  PALPATE_AVX2 static inline __m256 squares(__m256 x, __m256 y) {
    return _mm256_fmadd_ps(x, x, _mm256_mul_ps(y, y));
  }
  PALPATE_AVX2 static inline unsigned triangles(const WideTree::Triangles& t, const float* p, float limit,
                                                Lanes& out) {
    const __m256 rx = _mm256_sub_ps(_mm256_broadcast_ss(p), load(t.origin[0]));
    const __m256 ry = _mm256_sub_ps(_mm256_broadcast_ss(p + 1), load(t.origin[1]));
    const __m256 rz = _mm256_sub_ps(_mm256_broadcast_ss(p + 2), load(t.origin[2]));
    const __m256 x = dot(t.axis[0], rx, ry, rz), y = dot(t.axis[1], rx, ry, rz),
                 h = dot(t.axis[2], rx, ry, rz);
    const __m256 x1 = load(t.x1), x2 = load(t.x2), y2 = load(t.y2), one = _mm256_set1_ps(1);
    const __m256 dx = _mm256_sub_ps(x2, x1), wx = _mm256_sub_ps(x, x1), yy2 = _mm256_mul_ps(y, y2);
    const __m256 e01 = _mm256_sub_ps(x, clamp(x, x1));
    const __m256 s12 = clamp(_mm256_mul_ps(_mm256_fmadd_ps(wx, dx, yy2), load(t.inverse12)), one);
    const __m256 s20 = clamp(_mm256_mul_ps(_mm256_fmadd_ps(x, x2, yy2), load(t.inverse20)), one);
    const __m256 b12 = squares(_mm256_fnmadd_ps(s12, dx, wx), _mm256_fnmadd_ps(s12, y2, y));
    const __m256 b20 = squares(_mm256_fnmadd_ps(s20, x2, x), _mm256_fnmadd_ps(s20, y2, y));
    const __m256 beside = _mm256_min_ps(squares(e01, y), _mm256_min_ps(b12, b20));
    // The sign bits say on which side of the edges it is.
    const __m256 out12 = _mm256_fmsub_ps(dx, y, _mm256_mul_ps(y2, wx));
    const __m256 out20 = _mm256_fmsub_ps(y2, x, _mm256_mul_ps(x2, y));
    const __m256 outside = _mm256_or_ps(y, _mm256_or_ps(out12, out20));
    const __m256 distance2 = _mm256_fmadd_ps(h, h, _mm256_blendv_ps(_mm256_setzero_ps(), beside, outside));
    return near(distance2, limit, out) & t.lanes;
  }
  PALPATE_AVX2 static inline float smallest(const Lanes& lanes, unsigned mask) {
    const __m256i bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    const __m256i in =
        _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(static_cast<int>(mask)), bits), bits);
    const __m256 x = _mm256_blendv_ps(_mm256_set1_ps(std::numeric_limits<float>::infinity()), load(lanes),
                                      _mm256_castsi256_ps(in));
    __m128 m = _mm_min_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps(x, 1));
    m = _mm_min_ps(m, _mm_movehl_ps(m, m));
    return _mm_cvtss_f32(_mm_min_ss(m, _mm_shuffle_ps(m, m, 1)));
  }
};
#endif

}  // namespace

// Errors in units of the scale, each bounded with a margin of two: float32 rounds p and a triangle's origin
// to 6e-8 of their size, and what comes after to 5e-7 of their distance apart; boxes are not relative to an
// origin, so theirs are 6e-7 of |p| + 1.
template <class Kernels>
[[gnu::always_inline]] inline void WideTree::search_with(const Query& query) const {
  constexpr std::size_t most = 128, stack_size = 640;  // 80 levels of the binary tree, 7 more a level
  const Vec3 q = (query.p - center_) / scale_;
  const std::array<float, 3> p{static_cast<float>(q.x()), static_cast<float>(q.y()),
                               static_cast<float>(q.z())};
  const double reach = 1 + q.norm();
  const auto triangle_error = static_cast<float>(2.4e-7 * reach + 1e-6 * longest_);
  const auto box_error = static_cast<float>(1.2e-6 * reach);
  constexpr float relative = 1e-6f;
  float bound = static_cast<float>(query.bound / scale_ * (1 + 1e-7)), box_limit = 0, limit = 0;
  const auto tighten = [&] {
    const float b = bound * (1 + relative) + box_error, t = bound * (1 + relative) + triangle_error;
    box_limit = b * b, limit = t * t;
  };
  tighten();
  struct Candidate {
    float distance2;
    Index slot;
  };
  std::array<Candidate, most> list;
  std::size_t listed = 0;
  const auto deliver = [&] {
    std::array<Index, most> slots;
    std::size_t n = 0;
    for (std::size_t i = 0; i < listed; ++i)
      if (!(list[i].distance2 > limit)) slots[n++] = list[i].slot;
    listed = 0;
    if (n > 0) query.take(query.context, slots.data(), n);
  };
  alignas(32) Lanes distance2;
  const auto open_leaf = [&](Index number) {
    const Triangles& leaf = leaves_[static_cast<std::size_t>(number)];
    unsigned near = Kernels::triangles(leaf, p.data(), limit, distance2) | leaf.thin;
    const float least = std::sqrt(Kernels::smallest(distance2, near & ~leaf.thin));
    if (least * (1 + relative) + triangle_error < bound) {
      bound = least * (1 + relative) + triangle_error;
      tighten();
    }
    if (listed + 8 > most) deliver();
    for (; near != 0; near &= near - 1) {
      const auto lane = static_cast<unsigned>(__builtin_ctz(near));
      list[listed++] = {leaf.thin >> lane & 1u ? 0 : distance2[lane], leaf.first + static_cast<Index>(lane)};
    }
  };
  struct Entry {
    float bound;
    Index node;
  };
  std::array<Entry, stack_size> stack;
  std::size_t top = 0;
  const Index hint = query.hint < 0 ? -1 : leaf_of_[static_cast<std::size_t>(query.hint)];
  if (hint >= 0) open_leaf(hint);
  stack[top++] = {0, 0};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.bound > box_limit) continue;
    if (entry.node < 0) {
      if (~entry.node != hint) open_leaf(~entry.node);
      continue;
    }
    const Boxes& node = nodes_[static_cast<std::size_t>(entry.node)];
    unsigned near = Kernels::boxes(node, p.data(), box_limit, distance2);
    for (const std::size_t base = top; near != 0; near &= near - 1) {  // the nearest on top
      const auto lane = static_cast<std::size_t>(__builtin_ctz(near));
      const Index child = node.child[lane];
      prefetch(child < 0 ? static_cast<const void*>(&leaves_[static_cast<std::size_t>(~child)])
                         : &nodes_[static_cast<std::size_t>(child)]);
      std::size_t k = top++;
      for (; k > base && stack[k - 1].bound < distance2[lane]; --k) stack[k] = stack[k - 1];
      stack[k] = {distance2[lane], child};
    }
  }
  deliver();
}

#if defined(__x86_64__)
[[gnu::flatten]] PALPATE_AVX2 void WideTree::search_avx2(const Query& query) const {
  search_with<Avx2>(query);
}
#endif

void WideTree::search(const Query& query) const {
  if (nodes_.empty()) return;
#if defined(__x86_64__)
  if (simd_ != Simd::portable) return search_avx2(query);
#endif
  search_with<Portable>(query);
}

}  // namespace palpate
