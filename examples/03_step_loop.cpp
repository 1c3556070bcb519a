// A force loop: an instrument given by its surface is led over soft tissue, one step a tick.
#include <cstdio>

#include "palpate/compliance/blas.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/simulation/model.hpp"

using namespace palpate;

int main() try {
  set_up_blas();  // first thing, before any thread

  // 1. Soft tissue: a block of 60 x 60 x 20 mm, held at its bottom. read_organ() takes a model from a file.
  Model model;
  const Box block{Vec3(-0.03, -0.03, -0.02), Vec3(0.03, 0.03, 0)};
  model.organ = bake(make_block(block, {20, 20, 6}), {Material{5e3, 0.45}},
                     {AnchorHalfSpace{{0, 0, -0.0199}, {0, 0, 1}}});

  // 2. A rigid instrument: the lattice of a closed surface.
  TriangleMesh torus = make_torus(0.008, 0.003, 48, 24);
  const SignedDistanceField field(torus);
  const auto lattice =
      std::make_shared<const Lattice>(sample_lattice(field, make_grid(bounding_box(torus.vertices), 24)));
  model.instruments.push_back({"ring", lattice, std::move(torus)});

  // 3. Everything that changes; made once, so that a tick allocates nothing.
  State state = make_state(model);
  Input input;
  input.instruments.resize(1);
  input.instruments[0].rotation = Eigen::AngleAxisd(M_PI / 2, Vec3::UnitX());  // lies flat

  // 4. A second of one tick a millisecond: down, along, and up again.
  double slowest = 0;
  for (int tick = 0; tick <= 1000; ++tick) {
    const double t = input.time = 0.001 * tick;
    const double depth = 0.003 * std::min({1.0, 5 * t, 5 * (1 - t)});
    input.instruments[0].translation = Vec3(0.016 * (t - 0.5), 0, 0.003 - depth);
    step(model, state, input);
    slowest = std::max(slowest, state.times.total);
    if (tick % 100 == 0) {
      // 5. What a haptic device would feel, and what touches.
      Vec3 sum = Vec3::Zero();
      for (const Contact& contact : state.contacts) sum -= contact.force;
      std::printf("%4d ms: %2zu contacts, force (%6.3f %6.3f %6.3f) N, deepest %.2f mm before, %.4f after\n",
                  tick, state.contacts.size(), sum.x(), sum.y(), sum.z(), 1e3 * state.deepest_before,
                  1e3 * state.deepest_after);
    }
  }
  std::printf("slowest tick %.2f ms\n", 1e3 * slowest);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
