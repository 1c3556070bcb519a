// A force loop as the program has it, and places to press on.
#pragma once

#include "palpate/haptics/coupling.hpp"
#include "unit/simulation/fixtures.hpp"

namespace palpate {

struct ForceLoop {
  explicit ForceLoop(Model m) : model(std::move(m)), state(make_state(model)), input(at(Vec3::Zero())) {
    input.grips = {0};
  }

  // Reads and couples.
  void lead(HapticDevice& device, double dt = 1e-3) noexcept {
    sample = device.read();
    input.instruments[0] =
        couple(settings, coupling, sample, state.wrenches[0], dt, !(state.status & bad_input));
    input.grips[0] = sample.buttons != 0;
  }
  // Writes; returns what the hand felt.
  Wrench feel(HapticDevice& device) noexcept {
    const Wrench felt = hand_wrench(settings, coupling, state.wrenches[0]);
    device.write(felt);
    return felt;
  }
  Wrench tick(HapticDevice& device, double dt = 1e-3) noexcept {
    lead(device, dt);
    step(model, state, input);
    return feel(device);
  }

  double radius() const { return std::get<Sphere>(model.instruments[0].shape).radius; }

  Model model;
  State state;
  Input input;
  CouplingSettings settings;
  CouplingState coupling;
  DeviceSample sample;
};

// The handle goes where the test says.
struct HeldDevice final : HapticDevice {
  DeviceSample sample;
  Wrench felt;
  HeldDevice() { sample.connected = true; }
  DeviceSample read() noexcept override { return sample; }
  void write(const Wrench& on_hand) noexcept override { felt = on_hand; }
};

// The soft block with a pillar of stone, 50 mm wide, from the anchored base to the top: the stiffest place a
// hand can press on.
inline Model pillar_model(double young = 4e6) {
  TetMesh mesh = make_block({Vec3(-0.05, -0.05, 0), Vec3(0.05, 0.05, 0.1)}, {8, 8, 8});
  mesh.region_names = {"tissue", "stone"};
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    Vec3 c = Vec3::Zero();
    for (const Index n : mesh.tets[t]) c += 0.25 * mesh.nodes[static_cast<std::size_t>(n)];
    mesh.regions[t] = std::max(std::abs(c.x()), std::abs(c.y())) < 0.025;
  }
  Model model;
  model.organ = bake(std::move(mesh), {{10e3, 0.45, 1000}, {young, 0.3, 2000}},
                     {AnchorHalfSpace{Vec3::Zero(), Vec3::UnitZ()}}, 0, {}, nullptr, {.order = 1});
  model.instruments.push_back({"tool", Sphere{0.02}, {}});
  return model;
}

}  // namespace palpate
