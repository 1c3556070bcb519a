// The step allocates nothing, whatever happens in it: contact begins, slides, ends, inputs are bad.
#include <gtest/gtest.h>

#include <thread>

#include "fixtures.hpp"
#include "support/count_allocations.hpp"

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
