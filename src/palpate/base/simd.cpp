#include "palpate/base/simd.hpp"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

namespace palpate {

#if defined(__x86_64__)
namespace {
bool has_f16c() {  // __builtin_cpu_supports knows no "f16c" before gcc 11 and clang 16
  unsigned a = 0, b = 0, c = 0, d = 0;
  return __get_cpuid(1, &a, &b, &c, &d) && (c & bit_F16C);
}
}  // namespace
#endif

const char* name(Simd simd) {
  return simd == Simd::avx512 ? "AVX-512" : simd == Simd::avx2 ? "AVX2" : "portable";
}

Simd best_simd() {
#if defined(__x86_64__)
  static const Simd best = [] {
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") || !has_f16c())
      return Simd::portable;
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                   __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl")
               ? Simd::avx512
               : Simd::avx2;
  }();
  return best;
#else
  return Simd::portable;
#endif
}

}  // namespace palpate
