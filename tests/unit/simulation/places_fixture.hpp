// What the tests of contact between nodes press on, and the needle they press with.
#pragma once

#include <gtest/gtest.h>

#include "fixtures.hpp"

namespace palpate {

// 60 x 60 x 30 mm, its base fixed, 3 mm between nodes; its top at z = 0, nodes at multiples of 3 mm.
struct Places : ::testing::Test {
  static void SetUpTestSuite() {
    model.organ = bake(make_block({Vec3(-0.03, -0.03, -0.03), Vec3(0.03, 0.03, 0)}, {20, 20, 10}),
                       {{10e3, 0.45, 1000}}, {AnchorHalfSpace{Vec3(0, 0, -0.03), Vec3::UnitZ()}}, 0, {},
                       nullptr, {.order = 1, .pinch = false});
  }
  static void TearDownTestSuite() { model = {}; }
  static inline Model model;
  static constexpr double radius = 0.5e-3, length = 20e-3;

  void SetUp() override { model.settings = {}; }
  static void take(const Shape& shape, double tip = 0) { model.instruments = {{"fine", shape, {}, tip}}; }
  static void take_needle() { take(Capsule{radius, length}); }
  // The needle upright, its tip at p.
  static Input tip_at(const Vec3& p) { return at(p + Vec3(0, 0, length + radius)); }
  static double press(State& state, const Vec3& p) {
    step(model, state, tip_at(p));
    return state.wrenches[0].force.z();
  }
};

}  // namespace palpate
