// Which instruction set this machine has, of those there is special code for.
#pragma once

namespace palpate {

enum class Simd { portable, avx2, avx512 };  // avx2: with FMA and F16C; avx512: F, BW, DQ and VL
const char* name(Simd simd);
Simd best_simd();  // of this processor

}  // namespace palpate
