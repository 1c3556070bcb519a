#include "palpate/compliance/rows.hpp"

namespace palpate {

namespace {

// Compiled once for each instruction set below. No fused multiply-add, so every set gives the same bits.
template <std::size_t count>
[[gnu::always_inline]] inline void add(const float* const* rows, const float* weights, std::size_t n,
                                       float* u) noexcept {
  const float* row[count];
  float w[count];
  for (std::size_t k = 0; k < count; ++k) row[k] = rows[k], w[k] = weights[k];
  for (std::size_t i = 0; i < n; ++i) {
    float sum = u[i];
    for (std::size_t k = 0; k < count; ++k) sum += w[k] * row[k][i];
    u[i] = sum;
  }
}

[[gnu::always_inline]] inline void add_any(const float* const* rows, const float* weights, std::size_t count,
                                           std::size_t n, float* u) noexcept {
  std::size_t k = 0;
  for (; k + 12 <= count; k += 12) add<12>(rows + k, weights + k, n, u);
  for (; k + 3 <= count; k += 3) add<3>(rows + k, weights + k, n, u);
  for (; k < count; ++k) add<1>(rows + k, weights + k, n, u);
}

using AddRows = void (*)(const float* const*, const float*, std::size_t, std::size_t, float*) noexcept;

void add_portable(const float* const* rows, const float* weights, std::size_t count, std::size_t n,
                  float* u) noexcept {
  add_any(rows, weights, count, n, u);
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] void add_avx2(const float* const* rows, const float* weights, std::size_t count,
                                      std::size_t n, float* u) noexcept {
  add_any(rows, weights, count, n, u);
}

[[gnu::target("avx512f")]] void add_avx512(const float* const* rows, const float* weights, std::size_t count,
                                           std::size_t n, float* u) noexcept {
  add_any(rows, weights, count, n, u);
}

AddRows choose() {
  if (__builtin_cpu_supports("avx512f")) return add_avx512;
  if (__builtin_cpu_supports("avx2")) return add_avx2;
  return add_portable;
}
const AddRows chosen = choose();
#else
const AddRows chosen = add_portable;
#endif

}  // namespace

void add_rows(const float* const* rows, const float* weights, std::size_t count, std::size_t n,
              float* u) noexcept {
  chosen(rows, weights, count, n, u);
}

}  // namespace palpate
