// OpenBLAS, set up right. Call first thing in main(), before any thread: OpenBLAS 0.3.21 takes CPUs newer
// than itself for a Prescott and runs six times slower; this picks the kernels by what the CPU can do and
// limits OpenBLAS to one thread, since we run our own.
#pragma once

#include <string>

namespace palpate {

void set_up_blas();
std::string blas_core();  // the kernels in use, "SkylakeX"

}  // namespace palpate
