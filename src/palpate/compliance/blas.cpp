#include "palpate/compliance/blas.hpp"

#include <cblas.h>

#include <cstdlib>
#include <cstring>

// Exported by OpenBLAS builds that choose kernels at run time, in no header; weak, because others lack them.
extern "C" {
[[gnu::weak]] void gotoblas_dynamic_init(void);
[[gnu::weak]] void gotoblas_dynamic_quit(void);
[[gnu::weak]] int blas_thread_shutdown_(void);
}

namespace palpate {

namespace {

bool uses_avx2(const char* core) {
  for (const char* known : {"Haswell", "Zen", "Excavator", "SkylakeX", "Cooperlake", "SapphireRapids"})
    if (std::strcmp(core, known) == 0) return true;
  return false;
}

// The kernels this CPU should get; nullptr where OpenBLAS' own choice stands.
const char* better_core() {
#if defined(__x86_64__)
  if (uses_avx2(openblas_get_corename())) return nullptr;
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
    return "SkylakeX";
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return "Haswell";
#endif
  return nullptr;
}

}  // namespace

void set_up_blas() {
  const char* core = better_core();
  // A user's own OPENBLAS_CORETYPE is obeyed.
  if (core && gotoblas_dynamic_init && gotoblas_dynamic_quit && setenv("OPENBLAS_CORETYPE", core, 0) == 0) {
    gotoblas_dynamic_quit();
    gotoblas_dynamic_init();
  }
  openblas_set_num_threads(1);
  // Its own threads, which start with the library, would spin for a tenth of a second for nothing.
  if (blas_thread_shutdown_) blas_thread_shutdown_();
}

std::string blas_core() { return openblas_get_corename(); }

}  // namespace palpate
