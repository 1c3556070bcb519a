#include "palpate/compliance/rows.hpp"

#include "palpate/base/half.hpp"
#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace palpate {

namespace {

inline float value(float x) noexcept { return x; }
inline float value(std::uint16_t x) noexcept { return from_half(x); }

// No fused multiply-add, so every set of instructions gives the same bits. Entries from `begin` on.
template <class T>
void add_portable(const T* const* rows, const float* weights, std::size_t count, std::size_t begin,
                  std::size_t n, float* u) noexcept {
  for (std::size_t i = begin; i < n; ++i) {
    float sum = u[i];
    for (std::size_t k = 0; k < count; ++k) sum += weights[k] * value(rows[k][i]);
    u[i] = sum;
  }
}

constexpr std::size_t lanes = 16;

inline float fold(float* sum) noexcept {
  for (std::size_t half = lanes / 2; half > 0; half /= 2)
    for (std::size_t l = 0; l < half; ++l) sum[l] += sum[l + half];
  return sum[0];
}

void dots_portable(const float* a, std::size_t m, std::size_t n, const float* x, float* y) noexcept {
  for (std::size_t j = 0; j < n; ++j) {
    float sum[lanes] = {};
    std::size_t i = 0;
    for (; i + lanes <= m; i += lanes)
      for (std::size_t l = 0; l < lanes; ++l) sum[l] += a[j * m + i + l] * x[i + l];
    for (std::size_t l = 0; i + l < m; ++l) sum[l] += a[j * m + i + l] * x[i + l];
    y[j] += fold(sum);
  }
}

#if defined(__x86_64__)

// The compiler's own vectors for AVX-512 are 32 bytes long, a fifth slower.
[[gnu::target("avx512f")]] inline __m512 load512(const float* p) noexcept { return _mm512_loadu_ps(p); }
[[gnu::target("avx512f")]] inline __m512 load512(const std::uint16_t* p) noexcept {
  // Masked, with all bits set: gcc 12 warns of its own unmasked one.
  return _mm512_maskz_cvtph_ps(0xffff, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)));
}
[[gnu::target("avx2,f16c")]] inline __m256 load256(const float* p) noexcept { return _mm256_loadu_ps(p); }
[[gnu::target("avx2,f16c")]] inline __m256 load256(const std::uint16_t* p) noexcept {
  return _mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(p)));
}

// The last n < 16 entries: short rows of the hierarchical storage are mostly these.
template <std::size_t count>
[[gnu::target("avx512f")]] inline bool add_tail(const float* const* row, const __m512* w, std::size_t i,
                                                std::size_t n, float* u) noexcept {
  const auto mask = static_cast<__mmask16>((1u << (n - i)) - 1);
  __m512 sum = _mm512_maskz_loadu_ps(mask, u + i);
#pragma GCC unroll 24
  for (std::size_t k = 0; k < count; ++k)
    sum = _mm512_add_ps(sum, _mm512_mul_ps(w[k], _mm512_maskz_loadu_ps(mask, row[k] + i)));
  _mm512_mask_storeu_ps(u + i, mask, sum);
  return true;
}
template <std::size_t count>
[[gnu::target("avx512f")]] inline bool add_tail(const std::uint16_t* const*, const __m512*, std::size_t,
                                                std::size_t, float*) noexcept {
  return false;
}

template <std::size_t count, class T>
[[gnu::target("avx512f")]] void add_512(const T* const* rows, const float* weights, std::size_t n,
                                        float* u) noexcept {
  __m512 w[count];
  const T* row[count];
  for (std::size_t k = 0; k < count; ++k) w[k] = _mm512_set1_ps(weights[k]), row[k] = rows[k];
  std::size_t i = 0;
  for (; i + 16 <= n; i += 16) {
    __m512 sum = _mm512_loadu_ps(u + i);
#pragma GCC unroll 24
    for (std::size_t k = 0; k < count; ++k)
      sum = _mm512_add_ps(sum, _mm512_mul_ps(w[k], load512(row[k] + i)));
    _mm512_storeu_ps(u + i, sum);
  }
  if (i == n || add_tail<count>(row, w, i, n, u)) return;
  add_portable(rows, weights, count, i, n, u);
}

template <std::size_t count, class T>
[[gnu::target("avx2,f16c")]] void add_256(const T* const* rows, const float* weights, std::size_t n,
                                          float* u) noexcept {
  __m256 w[count];
  const T* row[count];
  for (std::size_t k = 0; k < count; ++k) w[k] = _mm256_set1_ps(weights[k]), row[k] = rows[k];
  std::size_t i = 0;
  for (; i + 8 <= n; i += 8) {
    __m256 sum = _mm256_loadu_ps(u + i);
#pragma GCC unroll 24
    for (std::size_t k = 0; k < count; ++k)
      sum = _mm256_add_ps(sum, _mm256_mul_ps(w[k], load256(row[k] + i)));
    _mm256_storeu_ps(u + i, sum);
  }
  add_portable(rows, weights, count, i, n, u);
}

[[gnu::target("avx512f")]] void dots_512(const float* a, std::size_t m, std::size_t n, const float* x,
                                         float* y) noexcept {
  const auto mask = static_cast<__mmask16>((1u << m % lanes) - 1);
  alignas(64) float sum[lanes];
  for (std::size_t j = 0; j < n; ++j) {
    __m512 s = _mm512_setzero_ps();
    std::size_t i = 0;
    for (; i + lanes <= m; i += lanes)
      s = _mm512_add_ps(s, _mm512_mul_ps(_mm512_loadu_ps(a + j * m + i), _mm512_loadu_ps(x + i)));
    if (i < m)
      s = _mm512_add_ps(
          s, _mm512_mul_ps(_mm512_maskz_loadu_ps(mask, a + j * m + i), _mm512_maskz_loadu_ps(mask, x + i)));
    _mm512_store_ps(sum, s);
    y[j] += fold(sum);
  }
}

enum class Vectors { none, avx2, avx512 };
Vectors choose() {
  if (__builtin_cpu_supports("avx512f")) return Vectors::avx512;
  // F16C came with the generation before AVX2; there is no name for it in older compilers' checks.
  if (__builtin_cpu_supports("avx2")) return Vectors::avx2;
  return Vectors::none;
}
const Vectors vectors = choose();

template <std::size_t count, class T>
void add(const T* const* rows, const float* weights, std::size_t n, float* u) noexcept {
  if (vectors == Vectors::avx512) return add_512<count>(rows, weights, n, u);
  if (vectors == Vectors::avx2) return add_256<count>(rows, weights, n, u);
  add_portable(rows, weights, count, 0, n, u);
}

#else

template <std::size_t count, class T>
void add(const T* const* rows, const float* weights, std::size_t n, float* u) noexcept {
  add_portable(rows, weights, count, 0, n, u);
}

#endif

template <class T>
void add_any(const T* const* rows, const float* weights, std::size_t count, std::size_t n,
             float* u) noexcept {
  std::size_t k = 0;
  for (; k + 24 <= count; k += 24) add<24>(rows + k, weights + k, n, u);
  for (; k + 6 <= count; k += 6) add<6>(rows + k, weights + k, n, u);
  for (; k + 3 <= count; k += 3) add<3>(rows + k, weights + k, n, u);
  for (; k < count; ++k) add<1>(rows + k, weights + k, n, u);
}

}  // namespace

void add_rows(const float* const* rows, const float* weights, std::size_t count, std::size_t n,
              float* u) noexcept {
  add_any(rows, weights, count, n, u);
}

void add_rows(const std::uint16_t* const* rows, const float* weights, std::size_t count, std::size_t n,
              float* u) noexcept {
  add_any(rows, weights, count, n, u);
}

void add_dots(const float* a, std::size_t m, std::size_t n, const float* x, float* y) noexcept {
#if defined(__x86_64__)
  if (vectors == Vectors::avx512) return dots_512(a, m, n, x, y);
#endif
  dots_portable(a, m, n, x, y);
}

}  // namespace palpate
