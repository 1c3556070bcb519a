#include "palpate/compliance/blas.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

extern "C" {
[[gnu::weak]] void gotoblas_dynamic_init(void);
[[gnu::weak]] void gotoblas_dynamic_quit(void);
int openblas_get_num_threads(void);
}

namespace {

// All tests of this program run on the right kernels.
class BlasSetUp : public testing::Environment {
  void SetUp() override { palpate::set_up_blas(); }
};
const auto* const blas_set_up = testing::AddGlobalTestEnvironment(new BlasSetUp);

bool fast(const std::string& core) {
  return core == "SkylakeX" || core == "Cooperlake" || core == "SapphireRapids" || core == "Haswell" ||
         core == "Zen";
}

TEST(Blas, TwiceIsSafeAndLeavesOneThread) {
  palpate::set_up_blas();
  const std::string core = palpate::blas_core();
  palpate::set_up_blas();
  EXPECT_EQ(palpate::blas_core(), core);
  EXPECT_EQ(openblas_get_num_threads(), 1);
}

TEST(Blas, GenericKernelsAreReplacedOnACpuWithAvx2) {
  if (!__builtin_cpu_supports("avx2") || !gotoblas_dynamic_init) GTEST_SKIP() << "needs AVX2 and OpenBLAS";
  const auto restart = [] { gotoblas_dynamic_quit(), gotoblas_dynamic_init(); };
  setenv("OPENBLAS_CORETYPE", "Prescott", 1);
  restart();
  EXPECT_EQ(palpate::blas_core(), "Prescott");
  palpate::set_up_blas();
  EXPECT_EQ(palpate::blas_core(), "Prescott") << "the user's own choice is obeyed";
  unsetenv("OPENBLAS_CORETYPE");
  palpate::set_up_blas();
  EXPECT_TRUE(fast(palpate::blas_core())) << palpate::blas_core();
}

}  // namespace
