// A first pass finds the cells and asks for their memory, a second one interpolates eight points at a time.
// Built without contraction to fused multiply-adds, so that all instruction sets give the same bits.
#include "palpate/lattice/lattice_batch.hpp"

#include <bit>
#include <cmath>

#if defined(__x86_64__)
#include <immintrin.h>
#if !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"  // gcc 12's own header, in gathers and narrowings
#endif
#define PALPATE_AVX2 __attribute__((target("avx2,f16c")))
#define PALPATE_AVX512 __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,avx2,f16c")))
#endif

namespace palpate {

std::uint16_t to_half(float x) {
  const auto bits = std::bit_cast<std::uint32_t>(x);
  const auto sign = static_cast<std::uint16_t>(bits >> 16 & 0x8000u);
  const float a = std::abs(x);
  if (!(a < 65520.0f)) return static_cast<std::uint16_t>(sign | (a > 0 ? 0x7c00u : 0x7e00u));
  if (a < 0x1p-14f)  // subnormal: a multiple of 2^-24
    return static_cast<std::uint16_t>(sign | static_cast<std::uint16_t>(std::nearbyint(a * 0x1p24f)));
  const std::uint32_t magnitude = bits & 0x7fffffffu;
  return static_cast<std::uint16_t>(sign |
                                    ((magnitude - 0x38000000u + 0xfffu + (magnitude >> 13 & 1u)) >> 13));
}

float from_half(std::uint16_t half) {
  const std::uint32_t sign = (half & 0x8000u) << 16, exponent = half >> 10 & 31u, fraction = half & 0x3ffu;
  if (exponent == 0) {
    const float x = static_cast<float>(fraction) * 0x1p-24f;
    return sign ? -x : x;
  }
  return std::bit_cast<float>(sign | (exponent == 31 ? 0x7f800000u : (exponent + 112) << 23) |
                              fraction << 13);
}

namespace {

using V = float __attribute__((vector_size(32)));  // passed by reference only: the ABI differs with AVX
struct alignas(64) Block {
  std::int32_t first[batch_size];  // number of the cell's lowest point
  float t[3][batch_size];          // where in the cell
  std::int32_t out[batch_size];    // 1: outside the grid
};

template <class Kernel>
[[gnu::always_inline]] inline void locate(const BatchView& view, const float* points, std::size_t n,
                                          Block& block, std::uint8_t* outside) {
  const float inverse = 1 / view.h;
  for (std::size_t i = 0; i < n; ++i) block.first[i] = 0, block.out[i] = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    const std::int32_t last = view.n[a] - 1;
    const auto end = static_cast<float>(last);
    const float origin = view.origin[a];
    for (std::size_t i = 0; i < n; ++i) {
      const float x = (points[3 * i + a] - origin) * inverse;
      float in = x > 0 ? x : 0;  // 0 where it is no number
      in = in < end ? in : end;
      block.out[i] |= x == in ? 0 : 1;
      std::int32_t cell = static_cast<std::int32_t>(in);
      cell = cell < last ? cell : last - 1;
      block.t[a][i] = in - static_cast<float>(cell);
      block.first[i] = block.first[i] * view.n[a] + cell;
    }
  }
  for (std::size_t i = 0; i < n; ++i) outside[i] = static_cast<std::uint8_t>(block.out[i]);
  const std::size_t whole = (n + 7) / 8 * 8;
  for (std::size_t i = n; i < whole; ++i) {
    block.first[i] = 0;
    for (auto& t : block.t) t[i] = 0;
  }
}

// What does not fit into the second cache is asked for ahead.
constexpr std::size_t cache = std::size_t{3} << 19;

[[gnu::always_inline]] inline void prefetch(const BatchView& view, const Block& block, std::size_t n) {
  const auto row = static_cast<std::size_t>(view.n[2]), sheet = row * static_cast<std::size_t>(view.n[1]);
  const std::size_t bytes = sheet * static_cast<std::size_t>(view.n[0]) * (view.quads ? 8 : 4);
  if (bytes <= cache) return;
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(block.first[i]);
    if (view.quads) {
      __builtin_prefetch(view.quads + at);
    } else {
      const float* v = view.values + at;
      __builtin_prefetch(v);
      __builtin_prefetch(v + row);
      __builtin_prefetch(v + sheet);
      __builtin_prefetch(v + sheet + row);
    }
  }
}

// Corners of eight cells: corner[4 i + 2 j + k].
struct Portable {
  static void corners(const BatchView& view, const std::int32_t* first, V* corner) {
    const auto row = static_cast<std::size_t>(view.n[2]), sheet = row * static_cast<std::size_t>(view.n[1]);
    for (std::size_t lane = 0; lane < 8; ++lane) {
      const auto at = static_cast<std::size_t>(first[lane]);
      for (std::size_t m = 0; m < 4; ++m)
        for (std::size_t k = 0; k < 2; ++k)
          corner[2 * m + k][lane] = view.quads
                                        ? from_half(static_cast<std::uint16_t>(view.quads[at + k] >> 16 * m))
                                        : view.values[at + (m >> 1) * sheet + (m & 1) * row + k];
    }
  }
};

#if defined(__x86_64__)
struct Avx2 {
  // Pairs of floats at eight places, the first ones and the second ones.
  PALPATE_AVX2 static inline void pairs(const float* base, const std::int32_t* at, V& first, V& second) {
    const __m256 low = four(base, at), high = four(base, at + 4);
    first = _mm256_shuffle_ps(low, high, 0x88);
    second = _mm256_shuffle_ps(low, high, 0xdd);
    in_order(first);
    in_order(second);
  }
  PALPATE_AVX2 static inline __m256 four(const float* base, const std::int32_t* at) {
    const __m256d all = _mm256_castsi256_pd(_mm256_set1_epi64x(-1));
    return _mm256_castpd_ps(
        _mm256_mask_i32gather_pd(_mm256_setzero_pd(), reinterpret_cast<const double*>(base),
                                 _mm_load_si128(reinterpret_cast<const __m128i*>(at)), all, 4));
  }
  PALPATE_AVX2 static inline void in_order(V& x) {
    x = _mm256_castpd_ps(_mm256_permute4x64_pd(_mm256_castps_pd(x), 0xd8));
  }
  PALPATE_AVX2 static inline void corners(const BatchView& view, const std::int32_t* first, V* corner) {
    const std::ptrdiff_t row = view.n[2], sheet = row * view.n[1];
    if (!view.quads) {
      for (std::size_t m = 0; m < 4; ++m)
        pairs(view.values + static_cast<std::ptrdiff_t>(m >> 1) * sheet +
                  static_cast<std::ptrdiff_t>(m & 1) * row,
              first, corner[2 * m], corner[2 * m + 1]);
      return;
    }
    __m256 p[8], q[8];  // eight values of each point, transposed
    for (std::size_t lane = 0; lane < 8; ++lane)
      p[lane] = _mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(view.quads + first[lane])));
    for (std::size_t i = 0; i < 8; i += 2) {
      q[i] = _mm256_unpacklo_ps(p[i], p[i + 1]);
      q[i + 1] = _mm256_unpackhi_ps(p[i], p[i + 1]);
    }
    for (std::size_t i = 0; i < 8; i += 4)
      for (std::size_t j = 0; j < 2; ++j) {
        p[i + 2 * j] = _mm256_shuffle_ps(q[i + j], q[i + j + 2], 0x44);
        p[i + 2 * j + 1] = _mm256_shuffle_ps(q[i + j], q[i + j + 2], 0xee);
      }
    for (std::size_t m = 0; m < 4; ++m) {
      corner[2 * m] = _mm256_permute2f128_ps(p[m], p[m + 4], 0x20);
      corner[2 * m + 1] = _mm256_permute2f128_ps(p[m], p[m + 4], 0x31);
    }
  }
};
#endif

template <class Kernel>
[[gnu::always_inline]] inline void interpolate(const BatchView& view, const float* points, std::size_t n,
                                               float* distance, float* gradient, std::uint8_t* outside) {
  Block block;
  locate<Kernel>(view, points, n, block, outside);
  prefetch(view, block, n);
  const float scale = view.quads ? view.h : 1, slope = view.quads ? 1 : 1 / view.h;
  alignas(32) float out[4][batch_size];
  for (std::size_t i = 0; i < n; i += 8) {
    V c[8] = {};
    Kernel::corners(view, block.first + i, c);
    const V &tx = *reinterpret_cast<const V*>(block.t[0] + i),
            &ty = *reinterpret_cast<const V*>(block.t[1] + i),
            &tz = *reinterpret_cast<const V*>(block.t[2] + i);
    const V z00 = c[1] - c[0], z01 = c[3] - c[2], z10 = c[5] - c[4], z11 = c[7] - c[6];
    const V a00 = c[0] + tz * z00, a01 = c[2] + tz * z01, a10 = c[4] + tz * z10, a11 = c[6] + tz * z11;
    const V y0 = a01 - a00, y1 = a11 - a10, b0 = a00 + ty * y0, b1 = a10 + ty * y1, x = b1 - b0;
    *reinterpret_cast<V*>(out[3] + i) = (b0 + tx * x) * scale;
    if (!gradient) continue;
    const V e0 = z00 + ty * (z01 - z00), e1 = z10 + ty * (z11 - z10);
    *reinterpret_cast<V*>(out[0] + i) = x * slope;
    *reinterpret_cast<V*>(out[1] + i) = (y0 + tx * (y1 - y0)) * slope;
    *reinterpret_cast<V*>(out[2] + i) = (e0 + tx * (e1 - e0)) * slope;
  }
  for (std::size_t i = 0; i < n; ++i) distance[i] = out[3][i];
  if (gradient)
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t a = 0; a < 3; ++a) gradient[3 * i + a] = out[a][i];
}

using Interpolate = void(const BatchView&, const float*, std::size_t, float*, float*, std::uint8_t*);
#if defined(__x86_64__)
PALPATE_AVX2 [[gnu::flatten]] void interpolate_avx2(const BatchView& v, const float* p, std::size_t n,
                                                    float* d, float* g, std::uint8_t* o) {
  interpolate<Avx2>(v, p, n, d, g, o);
}
PALPATE_AVX512 [[gnu::flatten]] void interpolate_avx512(const BatchView& v, const float* p, std::size_t n,
                                                        float* d, float* g, std::uint8_t* o) {
  interpolate<Avx2>(v, p, n, d, g, o);
}
#endif
void interpolate_portable(const BatchView& v, const float* p, std::size_t n, float* d, float* g,
                          std::uint8_t* o) {
  interpolate<Portable>(v, p, n, d, g, o);
}

}  // namespace

void interpolate_batch(const BatchView& view, Simd simd, const float* points, std::size_t n, float* distance,
                       float* gradient, std::uint8_t* outside) {
  Interpolate* run = interpolate_portable;
#if defined(__x86_64__)
  if (simd == Simd::avx2) run = interpolate_avx2;
  if (simd == Simd::avx512) run = interpolate_avx512;
#endif
  run(view, points, n, distance, gradient, outside);
}

}  // namespace palpate
