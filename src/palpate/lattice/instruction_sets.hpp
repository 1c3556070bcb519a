// What the batches need of each instruction set: portable code, AVX2 and AVX-512. For lattice_batch.cpp
// alone.
#pragma once

#include "palpate/lattice/lattice_batch.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#if !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"  // gcc 12's own header, in gathers and narrowings
#endif
#define PALPATE_AVX2 __attribute__((target("avx2,f16c")))
#define PALPATE_AVX512 __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,avx2,f16c")))
#endif

namespace palpate {
namespace {

// Types wider than a register are passed by reference only: their ABI differs with AVX.
using Float8 = float __attribute__((vector_size(32)));
using Int8 = std::int32_t __attribute__((vector_size(32)));
using Float16 = float __attribute__((vector_size(64)));
using Int16 = std::int32_t __attribute__((vector_size(64)));

// What there is of each instruction set: `width` points at a time,
// split: x y z of them, from x y z x y z ...; join: the reverse;
// corners: of their cells, corner[4 i + 2 j + k];
// jets: four floats at each of `width` places, from + 4 first[i], as four registers.
template <class Floats, class Ints>
struct Portable {
  using V = Floats;
  using I = Ints;
  static constexpr std::size_t width = sizeof(V) / sizeof(float);
  static float& lane(V& x, std::size_t i) { return reinterpret_cast<float*>(&x)[i]; }
  static void split(const float* points, V* x) {
    for (std::size_t i = 0; i < width; ++i)
      for (std::size_t a = 0; a < 3; ++a) lane(x[a], i) = points[3 * i + a];
  }
  static void join(V* x, float* points) {
    for (std::size_t i = 0; i < width; ++i)
      for (std::size_t a = 0; a < 3; ++a) points[3 * i + a] = lane(x[a], i);
  }
  static void corners(const BatchView& view, const std::int32_t* first, V* corner) {
    const auto row = static_cast<std::size_t>(view.stored[2]),
               sheet = row * static_cast<std::size_t>(view.stored[1]);
    for (std::size_t i = 0; i < width; ++i) {
      const auto at = static_cast<std::size_t>(first[i]);
      for (std::size_t m = 0; m < 4; ++m)
        for (std::size_t k = 0; k < 2; ++k)
          lane(corner[2 * m + k], i) =
              view.quads ? from_half(static_cast<std::uint16_t>(view.quads[at + k] >> 16 * m))
                         : view.values[at + (m >> 1) * sheet + (m & 1) * row + k];
    }
  }
  static void jets(const float* from, const std::int32_t* first, V* x) {
    for (std::size_t i = 0; i < width; ++i)
      for (std::size_t a = 0; a < 4; ++a) lane(x[a], i) = from[4 * static_cast<std::size_t>(first[i]) + a];
  }
};
using Eight = Portable<Float8, Int8>;
using One = Portable<float, std::int32_t>;

#if defined(__x86_64__)
struct Avx2 {
  static constexpr std::size_t width = 8;
  using V = Float8;
  using I = Int8;
  static void split(const float* points, V* x) { Eight::split(points, x); }
  static void join(V* x, float* points) { Eight::join(x, points); }
  PALPATE_AVX2 static inline void corners(const BatchView& view, const std::int32_t* first, V* corner) {
    const std::ptrdiff_t row = view.stored[2], sheet = row * view.stored[1];
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
  PALPATE_AVX2 static inline void jets(const float* from, const std::int32_t* first, V* x) {
    __m256 p[4];
    for (std::size_t i = 0; i < 4; ++i)
      p[i] = _mm256_insertf128_ps(_mm256_castps128_ps256(jet(from, first[i])), jet(from, first[i + 4]), 1);
    const __m256 ab[] = {_mm256_unpacklo_ps(p[0], p[1]), _mm256_unpackhi_ps(p[0], p[1])},
                 cd[] = {_mm256_unpacklo_ps(p[2], p[3]), _mm256_unpackhi_ps(p[2], p[3])};
    for (std::size_t k = 0; k < 2; ++k) {
      x[2 * k] = _mm256_shuffle_ps(ab[k], cd[k], 0x44);
      x[2 * k + 1] = _mm256_shuffle_ps(ab[k], cd[k], 0xee);
    }
  }
  PALPATE_AVX2 static inline __m128 jet(const float* from, std::ptrdiff_t at) {
    return _mm_loadu_ps(from + 4 * at);
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
  PALPATE_AVX512 static inline void join(V* x, float* points) {
    static constexpr Places places = join_places();
    for (std::size_t r = 0; r < 3; ++r) {
      __m512 out;
      permute(places, x, r, out);
      _mm512_storeu_ps(points + 16 * r, out);
    }
  }
  PALPATE_AVX512 static inline void corners(const BatchView& view, const std::int32_t* first, V* corner) {
    const std::ptrdiff_t row = view.stored[2], sheet = row * view.stored[1];
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
  PALPATE_AVX512 static inline void jets(const float* from, const std::int32_t* first, V* x) {
    __m512 p[4];
    for (std::size_t i = 0; i < 4; ++i) {
      p[i] = _mm512_castps128_ps512(Avx2::jet(from, first[i]));
      p[i] = _mm512_insertf32x4(p[i], Avx2::jet(from, first[i + 4]), 1);
      p[i] = _mm512_insertf32x4(p[i], Avx2::jet(from, first[i + 8]), 2);
      p[i] = _mm512_insertf32x4(p[i], Avx2::jet(from, first[i + 12]), 3);
    }
    const __m512 ab[] = {_mm512_unpacklo_ps(p[0], p[1]), _mm512_unpackhi_ps(p[0], p[1])},
                 cd[] = {_mm512_unpacklo_ps(p[2], p[3]), _mm512_unpackhi_ps(p[2], p[3])};
    for (std::size_t k = 0; k < 2; ++k) {
      x[2 * k] = _mm512_shuffle_ps(ab[k], cd[k], 0x44);
      x[2 * k + 1] = _mm512_shuffle_ps(ab[k], cd[k], 0xee);
    }
  }
};
#endif

}  // namespace
}  // namespace palpate
