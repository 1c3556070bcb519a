#include "palpate/base/simd.hpp"

namespace palpate {

const char* name(Simd simd) {
  return simd == Simd::avx512 ? "AVX-512" : simd == Simd::avx2 ? "AVX2" : "portable";
}

Simd best_simd() {
#if defined(__x86_64__)
  static const Simd best = [] {
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return Simd::portable;
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
