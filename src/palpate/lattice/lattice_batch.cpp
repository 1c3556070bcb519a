// One pass finds the cells and asks for their memory, another one interpolates, 16 points at a time with
// AVX-512. Built without contraction to fused multiply-adds, so that all instruction sets give the same bits.
#include "palpate/lattice/lattice_batch.hpp"

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

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

// Types wider than a register are passed by reference only: their ABI differs with AVX.
using Float8 = float __attribute__((vector_size(32)));
using Int8 = std::int32_t __attribute__((vector_size(32)));
using Float16 = float __attribute__((vector_size(64)));
using Int16 = std::int32_t __attribute__((vector_size(64)));

// What there is of each instruction set: `width` points at a time,
// split: x y z of them, from x y z x y z ...; join: the reverse;
// corners: of their cells, corner[4 i + 2 j + k].
struct Portable {
  static constexpr std::size_t width = 8;
  using V = Float8;
  using I = Int8;
  static void split(const float* points, V* x) {
    for (std::size_t i = 0; i < width; ++i)
      for (std::size_t a = 0; a < 3; ++a) x[a][i] = points[3 * i + a];
  }
  static void join(const V* x, float* points) {
    for (std::size_t i = 0; i < width; ++i)
      for (std::size_t a = 0; a < 3; ++a) points[3 * i + a] = x[a][i];
  }
  static void corners(const BatchView& view, const std::int32_t* first, V* corner) {
    const auto row = static_cast<std::size_t>(view.n[2]), sheet = row * static_cast<std::size_t>(view.n[1]);
    for (std::size_t lane = 0; lane < width; ++lane) {
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
  static constexpr std::size_t width = 8;
  using V = Float8;
  using I = Int8;
  static void split(const float* points, V* x) { Portable::split(points, x); }
  static void join(const V* x, float* points) { Portable::join(x, points); }
  PALPATE_AVX2 static inline void corners(const BatchView& view, const std::int32_t* first, V* corner) {
    const std::ptrdiff_t row = view.n[2], sheet = row * view.n[1];
    if (view.quads) return from_quads(view.quads, first, corner);
    for (std::size_t m = 0; m < 4; ++m)
      pairs(view.values + static_cast<std::ptrdiff_t>(m >> 1) * sheet +
                static_cast<std::ptrdiff_t>(m & 1) * row,
            first, corner[2 * m], corner[2 * m + 1]);
  }
  // Pairs of floats at eight places, the first ones and the second ones.
  PALPATE_AVX2 static inline void pairs(const float* base, const std::int32_t* at, V& first, V& second) {
    const __m256 low = four(base, at), high = four(base, at + 4);
    first = in_order(_mm256_shuffle_ps(low, high, 0x88));
    second = in_order(_mm256_shuffle_ps(low, high, 0xdd));
  }
  PALPATE_AVX2 static inline __m256 four(const float* base, const std::int32_t* at) {
    const __m256d all = _mm256_castsi256_pd(_mm256_set1_epi64x(-1));
    return _mm256_castpd_ps(
        _mm256_mask_i32gather_pd(_mm256_setzero_pd(), reinterpret_cast<const double*>(base),
                                 _mm_load_si128(reinterpret_cast<const __m128i*>(at)), all, 4));
  }
  PALPATE_AVX2 static inline __m256 in_order(__m256 x) {
    return _mm256_castpd_ps(_mm256_permute4x64_pd(_mm256_castps_pd(x), 0xd8));
  }
  // Two quads a point, transposed: points 0 and 4 in one register, 1 and 5 in the next.
  PALPATE_AVX2 static inline void from_quads(const std::uint64_t* quads, const std::int32_t* first,
                                             V* corner) {
    __m256i p[4];
    for (std::size_t i = 0; i < 4; ++i)
      p[i] = _mm256_inserti128_si256(_mm256_castsi128_si256(two(quads + first[i])), two(quads + first[i + 4]),
                                     1);
    const __m256i ab[] = {_mm256_unpacklo_epi16(p[0], p[1]), _mm256_unpackhi_epi16(p[0], p[1])},
                  cd[] = {_mm256_unpacklo_epi16(p[2], p[3]), _mm256_unpackhi_epi16(p[2], p[3])};
    for (std::size_t k = 0; k < 2; ++k)
      for (std::size_t m = 0; m < 2; ++m) {
        const __m256i both = _mm256_permute4x64_epi64(
            m == 0 ? _mm256_unpacklo_epi32(ab[k], cd[k]) : _mm256_unpackhi_epi32(ab[k], cd[k]), 0xd8);
        corner[4 * m + k] = _mm256_cvtph_ps(_mm256_castsi256_si128(both));
        corner[4 * m + 2 + k] = _mm256_cvtph_ps(_mm256_extracti128_si256(both, 1));
      }
  }
  PALPATE_AVX2 static inline __m128i two(const std::uint64_t* quads) {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(quads));
  }
};

struct Avx512 {
  static constexpr std::size_t width = 16;
  using V = Float16;
  using I = Int16;
  // Where each number of the result comes from, for vpermt2ps: 16 and more means the second register.
  struct Places {
    alignas(64) std::int32_t first[3][16], second[3][16];
  };
  static constexpr Places split_places() {
    Places out{};
    for (int a = 0; a < 3; ++a)
      for (int i = 0; i < 16; ++i) {
        const int at = 3 * i + a;  // of 48
        out.first[a][i] = at < 32 ? at : 0;
        out.second[a][i] = at < 32 ? i : at - 32 + 16;
      }
    return out;
  }
  static constexpr Places join_places() {
    Places out{};
    for (int r = 0; r < 3; ++r)
      for (int i = 0; i < 16; ++i) {
        const int point = (16 * r + i) / 3, axis = (16 * r + i) % 3;
        out.first[r][i] = axis < 2 ? point + 16 * axis : 0;
        out.second[r][i] = axis < 2 ? i : point + 16;
      }
    return out;
  }
  PALPATE_AVX512 static inline void permute(const Places& places, const __m512* from, std::size_t a,
                                            __m512& to) {
    to = _mm512_permutex2var_ps(_mm512_permutex2var_ps(from[0], _mm512_load_si512(places.first[a]), from[1]),
                                _mm512_load_si512(places.second[a]), from[2]);
  }
  PALPATE_AVX512 static inline void split(const float* points, V* x) {
    static constexpr Places places = split_places();
    const __m512 in[] = {_mm512_loadu_ps(points), _mm512_loadu_ps(points + 16), _mm512_loadu_ps(points + 32)};
    for (std::size_t a = 0; a < 3; ++a) permute(places, in, a, x[a]);
  }
  PALPATE_AVX512 static inline void join(const V* x, float* points) {
    static constexpr Places places = join_places();
    for (std::size_t r = 0; r < 3; ++r) {
      __m512 out;
      permute(places, x, r, out);
      _mm512_storeu_ps(points + 16 * r, out);
    }
  }
  PALPATE_AVX512 static inline void corners(const BatchView& view, const std::int32_t* first, V* corner) {
    const std::ptrdiff_t row = view.n[2], sheet = row * view.n[1];
    if (view.quads) return from_quads(view.quads, first, corner);
    const __m256i low = _mm256_load_si256(reinterpret_cast<const __m256i*>(first)),
                  high = _mm256_load_si256(reinterpret_cast<const __m256i*>(first + 8));
    const __m512i even = _mm512_set_epi32(30, 28, 26, 24, 22, 20, 18, 16, 14, 12, 10, 8, 6, 4, 2, 0),
                  odd = _mm512_set_epi32(31, 29, 27, 25, 23, 21, 19, 17, 15, 13, 11, 9, 7, 5, 3, 1);
    for (std::size_t m = 0; m < 4; ++m) {
      const float* base = view.values + static_cast<std::ptrdiff_t>(m >> 1) * sheet +
                          static_cast<std::ptrdiff_t>(m & 1) * row;
      const __m512 a = eight(base, low), b = eight(base, high);
      corner[2 * m] = _mm512_permutex2var_ps(a, even, b);
      corner[2 * m + 1] = _mm512_permutex2var_ps(a, odd, b);
    }
  }
  PALPATE_AVX512 static inline __m512 eight(const float* base, __m256i at) {
    return _mm512_castpd_ps(_mm512_i32gather_pd(at, base, 4));
  }
  // As Avx2, points 0, 4, 8 and 12 in one register.
  PALPATE_AVX512 static inline void from_quads(const std::uint64_t* quads, const std::int32_t* first,
                                               V* corner) {
    __m512i p[4];
    for (std::size_t i = 0; i < 4; ++i) {
      __m512i x = _mm512_castsi128_si512(Avx2::two(quads + first[i]));
      x = _mm512_inserti32x4(x, Avx2::two(quads + first[i + 4]), 1);
      x = _mm512_inserti32x4(x, Avx2::two(quads + first[i + 8]), 2);
      p[i] = _mm512_inserti32x4(x, Avx2::two(quads + first[i + 12]), 3);
    }
    const __m512i ab[] = {_mm512_unpacklo_epi16(p[0], p[1]), _mm512_unpackhi_epi16(p[0], p[1])},
                  cd[] = {_mm512_unpacklo_epi16(p[2], p[3]), _mm512_unpackhi_epi16(p[2], p[3])};
    const __m512i halves = _mm512_set_epi64(7, 5, 3, 1, 6, 4, 2, 0);
    for (std::size_t k = 0; k < 2; ++k)
      for (std::size_t m = 0; m < 2; ++m) {
        const __m512i both = _mm512_permutexvar_epi64(
            halves, m == 0 ? _mm512_unpacklo_epi32(ab[k], cd[k]) : _mm512_unpackhi_epi32(ab[k], cd[k]));
        corner[4 * m + k] = _mm512_cvtph_ps(_mm512_castsi512_si256(both));
        corner[4 * m + 2 + k] = _mm512_cvtph_ps(_mm512_extracti64x4_epi64(both, 1));
      }
  }
};
#endif

// Points whose cells are found, and their memory asked for, ahead of the interpolation.
constexpr std::size_t most_ahead = 128;
constexpr std::size_t cache = std::size_t{3} << 19;  // what is smaller needs no asking

struct alignas(64) Cells {
  std::int32_t first[most_ahead];  // number of the cell's lowest point
  float t[3][most_ahead];          // where in the cell: 0..1 along each axis
  float none[most_ahead];          // 0, or no number outside the grid
};

[[gnu::always_inline]] inline void prefetch(const BatchView& view, const std::int32_t* first, std::size_t n) {
  const auto row = static_cast<std::size_t>(view.n[2]), sheet = row * static_cast<std::size_t>(view.n[1]);
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(first[i]);
    if (view.quads) {
      __builtin_prefetch(view.quads + at, 0, 2);
    } else {
      const float* v = view.values + at;
      __builtin_prefetch(v, 0, 2);
      __builtin_prefetch(v + row, 0, 2);
      __builtin_prefetch(v + sheet, 0, 2);
      __builtin_prefetch(v + sheet + row, 0, 2);
    }
  }
}

// n: of these points, up to Kernel::width.
template <class Kernel>
[[gnu::always_inline]] inline void locate(const BatchView& view, const float* points, std::size_t n,
                                          std::size_t slot, Cells& cells) {
  using V = typename Kernel::V;
  using I = typename Kernel::I;
  const float inverse = 1 / view.h;
  float last[3 * Kernel::width] = {};
  if (n < Kernel::width) std::memcpy(last, points, 3 * n * sizeof(float));
  V x[3];
  Kernel::split(n < Kernel::width ? last : points, x);
  I first{};
  V none{};
  for (std::size_t a = 0; a < 3; ++a) {
    const std::int32_t cells_along = view.n[a] - 1;
    const V zero{}, end = zero + static_cast<float>(cells_along);
    const V at = (x[a] - view.origin[a]) * inverse;
    V in = at > 0 ? at : zero;  // 0 where it is no number
    in = in < end ? in : end;
    none += (at - in) * (at - in);
    I cell = __builtin_convertvector(in, I);
    cell = cell < cells_along ? cell : I{} + (cells_along - 1);
    const V t = in - __builtin_convertvector(cell, V);
    std::memcpy(cells.t[a] + slot, &t, sizeof t);
    first = first * view.n[a] + cell;
  }
  none = none > 0 ? V{} + std::numeric_limits<float>::quiet_NaN() : none;
  std::memcpy(cells.first + slot, &first, sizeof first);
  std::memcpy(cells.none + slot, &none, sizeof none);
}

template <class Kernel>
[[gnu::always_inline]] inline void interpolate(const BatchView& view, const Cells& cells, std::size_t slot,
                                               std::size_t n, float* distance, float* gradient) {
  using V = typename Kernel::V;
  const float scale = view.quads ? view.h : 1, slope = view.quads ? 1 : 1 / view.h;
  const auto load = [&](const float* from) { return reinterpret_cast<const V*>(from + slot); };
  V c[8];
  Kernel::corners(view, cells.first + slot, c);
  const V &tx = *load(cells.t[0]), &ty = *load(cells.t[1]), &tz = *load(cells.t[2]);
  const V z00 = c[1] - c[0], z01 = c[3] - c[2], z10 = c[5] - c[4], z11 = c[7] - c[6];
  const V a00 = c[0] + tz * z00, a01 = c[2] + tz * z01, a10 = c[4] + tz * z10, a11 = c[6] + tz * z11;
  const V y0 = a01 - a00, y1 = a11 - a10, b0 = a00 + ty * y0, b1 = a10 + ty * y1, x = b1 - b0;
  const V d = (b0 + tx * x) * scale + *load(cells.none);
  std::memcpy(distance, &d, n == Kernel::width ? sizeof d : n * sizeof(float));
  if (!gradient) return;
  const V e0 = z00 + ty * (z01 - z00), e1 = z10 + ty * (z11 - z10);
  const V g[] = {x * slope, (y0 + tx * (y1 - y0)) * slope, (e0 + tx * (e1 - e0)) * slope};
  if (n == Kernel::width) return Kernel::join(g, gradient);
  float last[3 * Kernel::width];
  Kernel::join(g, last);
  std::memcpy(gradient, last, 3 * n * sizeof(float));
}

// A ring: while some points are interpolated the memory of the next ones is on its way.
template <class Kernel>
[[gnu::always_inline]] inline void run(const BatchView& view, const float* points, std::size_t n,
                                       float* distance, float* gradient) {
  constexpr std::size_t width = Kernel::width;
  const std::size_t ahead = std::min(most_ahead, (n + width - 1) / width * width);
  const std::size_t grid = std::size_t(view.n[0]) * std::size_t(view.n[1]) * std::size_t(view.n[2]);
  const bool ask = grid * (view.quads ? 8 : 4) > cache;
  Cells cells;
  for (std::size_t i = 0, slot = 0; i < n + ahead; i += width, slot = (slot + width) % ahead) {
    if (i >= ahead) {
      const std::size_t at = i - ahead;
      interpolate<Kernel>(view, cells, slot, std::min(width, n - at), distance + at,
                          gradient ? gradient + 3 * at : nullptr);
    }
    if (i < n) {
      locate<Kernel>(view, points + 3 * i, std::min(width, n - i), slot, cells);
      if (ask) prefetch(view, cells.first + slot, width);
    }
  }
}

using Run = void(const BatchView&, const float*, std::size_t, float*, float*);
void run_portable(const BatchView& v, const float* p, std::size_t n, float* d, float* g) {
  run<Portable>(v, p, n, d, g);
}
#if defined(__x86_64__)
PALPATE_AVX2 [[gnu::flatten]] void run_avx2(const BatchView& v, const float* p, std::size_t n, float* d,
                                            float* g) {
  run<Avx2>(v, p, n, d, g);
}
PALPATE_AVX512 [[gnu::flatten]] void run_avx512(const BatchView& v, const float* p, std::size_t n, float* d,
                                                float* g) {
  run<Avx512>(v, p, n, d, g);
}
#endif

}  // namespace

void interpolate_batch(const BatchView& view, Simd simd, const float* points, std::size_t n, float* distance,
                       float* gradient) {
  Run* chosen = run_portable;
#if defined(__x86_64__)
  if (simd == Simd::avx2) chosen = run_avx2;
  if (simd == Simd::avx512) chosen = run_avx512;
#endif
  if (n > 0) chosen(view, points, n, distance, gradient);
}

}  // namespace palpate
