// The step allocates nothing, whatever happens in it: contact begins, slides, ends, inputs are bad.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <thread>

#include "fixtures.hpp"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define PALPATE_COUNTS_ALLOCATIONS 0  // the sanitizers have their own malloc
#else
#define PALPATE_COUNTS_ALLOCATIONS 1
#endif

namespace {
std::atomic<std::size_t> allocations{0};
}

#if PALPATE_COUNTS_ALLOCATIONS
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
// NOLINTBEGIN: glibc's names, so that libraries are counted, too
void* malloc(std::size_t n) {
  ++allocations;
  return __libc_malloc(n);
}
void* calloc(std::size_t n, std::size_t size) {
  ++allocations;
  return __libc_calloc(n, size);
}
void* realloc(void* p, std::size_t n) {
  ++allocations;
  return __libc_realloc(p, n);
}
void* aligned_alloc(std::size_t a, std::size_t n) {
  ++allocations;
  return __libc_memalign(a, n);
}
int posix_memalign(void** p, std::size_t a, std::size_t n) {
  ++allocations;
  *p = __libc_memalign(a, n);
  return *p ? 0 : 12;
}
// NOLINTEND
}
#endif

namespace palpate {
namespace {

TEST(Step, AllocatesNothing) {
  if (!PALPATE_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizers have their own malloc";
  const std::size_t before = allocations;
  void* volatile block = std::malloc(8);
  std::free(block);
  ASSERT_GT(allocations, before);  // it does count
  const TriangleMesh torus = make_torus(0.03, 0.012, 40, 20);
  for (const Storage storage : all_storages) {
    Model model;
    // Quadratic with one storage: the other tetrahedra, and their projection.
    model.organ = block_organ(8, {storage == Storage::half ? 2 : 1, storage, 1e-3, 0});
    for (const Mode mode : {Mode::unilateral, Mode::prescribed, Mode::gaussian, Mode::imprint})
      for (const Shape& shape : {Shape{Sphere{0.03}}, lattice_of(torus, 2e-3)}) {
        model.instruments = {{"tool", shape, surface_of_primitive(shape)}};
        model.settings.mode = mode;
        std::vector<Input> inputs;
        for (int k = 0; k < 40; ++k) {
          const double depth = 0.010 * std::min({1.0, k / 10.0, (39 - k) / 10.0}) - 0.001;
          inputs.push_back(at(Vec3(-0.02 + 0.001 * k, 0.003, 0.1 + half_height(shape) - depth)));
        }
        inputs.push_back(at(Vec3(0, 0, std::nan(""))));
        inputs.push_back({});
        inputs.push_back(at(Vec3(0, 0, 0.11)));  // a jump deep into it
        State state = make_state(model);
        std::size_t most = 0, allocated = 0;
        // A thread of its own, as the force loop has: what others have allocated for themselves is no help.
        std::jthread([&] {
          const std::size_t start = allocations;
          for (const Input& input : inputs) {
            step(model, state, input);
            most = std::max(most, state.contacts.size());
          }
          allocated = allocations - start;
        }).join();
        EXPECT_EQ(allocated, 0u) << name(mode) << ' ' << storage_name(storage);
        EXPECT_GT(most, 3u) << name(mode) << ' ' << storage_name(storage);
      }
  }
}

}  // namespace
}  // namespace palpate
