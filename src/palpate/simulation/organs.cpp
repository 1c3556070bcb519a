#include "palpate/simulation/organs.hpp"

#include <algorithm>

#include "palpate/base/error.hpp"

namespace palpate {

std::vector<State> make_states(std::span<const Model> models) {
  if (models.empty()) throw Error(ErrorKind::usage, "no organ to simulate");
  std::vector<State> states;
  for (const Model& model : models) {
    if (!std::equal(model.instruments.begin(), model.instruments.end(), models[0].instruments.begin(),
                    models[0].instruments.end(),
                    [](const Instrument& a, const Instrument& b) { return a.name == b.name; }))
      throw Error(ErrorKind::usage, "organ {} has other instruments than the first; give all the same",
                  states.size() + 1);
    states.push_back(make_state(model));
  }
  return states;
}

std::vector<Input> make_inputs(std::span<const Model> models) {
  std::vector<Input> inputs(models.size());
  for (std::size_t i = 0; i < models.size(); ++i) {
    inputs[i].instruments.resize(models[i].instruments.size());
    inputs[i].grips.resize(models[i].instruments.size());
  }
  return inputs;
}

Pose clear_of(std::span<const Model> models, std::span<const Input> inputs, std::size_t instrument) noexcept {
  Box all;
  for (std::size_t i = 0; i < models.size(); ++i)
    for (const Vec3& v : models[i].organ.surface.vertices) all.add(inputs[i].organ * v);
  // Below, as every shape, a half-space too, has a top.
  const double top = bounding_box(models[0].instruments[instrument].shape).max.z();
  return {Eigen::Quaterniond::Identity(),
          Vec3(all.center().x(), all.center().y(), all.min.z() - all.diagonal() - top)};
}

}  // namespace palpate
