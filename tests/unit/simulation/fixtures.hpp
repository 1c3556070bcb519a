// Small organs and instruments for the simulation's tests.
#pragma once

#include "palpate/compliance/blas.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/simulation/model.hpp"

namespace palpate {

inline const bool blas_is_set_up = (set_up_blas(), true);

// 10 cm cube, base fixed, E = 10 kPa, nu = 0.45, n^3 cells (PEERS' block).
inline Organ block_organ(int n, const BakeOptions& options = {.order = 1, .pinch = false}) {
  return bake(make_block({Vec3(-0.05, -0.05, 0), Vec3(0.05, 0.05, 0.1)}, {n, n, n}), {{10e3, 0.45, 1000}},
              {AnchorHalfSpace{Vec3::Zero(), Vec3::UnitZ()}}, 0, {}, nullptr, options);
}
constexpr Storage all_storages[] = {Storage::dense, Storage::half, Storage::factored, Storage::hierarchical};

inline Model block_model(int n, const Shape& shape, Mode mode = Mode::unilateral, int order = 1) {
  Model model;
  model.organ = block_organ(n, {.order = order, .pinch = false});
  model.instruments.push_back({"tool", shape, surface_of_primitive(shape)});
  model.settings.mode = mode;
  return model;
}

// What a scene makes of a surface: a lattice with two cells of margin.
inline Shape lattice_of(const TriangleMesh& surface, double h) {
  return std::make_shared<const Lattice>(sample_lattice(
      SignedDistanceField(surface), make_grid_spaced(bounding_box(surface.vertices), h, 2 * h)));
}

// Half the height of a shape that is symmetric about its origin; a lattice's box has a margin.
inline double half_height(const Shape& shape) {
  const auto* lattice = std::get_if<std::shared_ptr<const Lattice>>(&shape);
  return bounding_box(shape).max.z() - (lattice ? 2 * (*lattice)->grid().h : 0.0);
}

// The instrument's origin at p, the organ where it is.
inline Input at(const Vec3& p, const Eigen::Quaterniond& q = Eigen::Quaterniond::Identity()) {
  Input input;
  input.instruments.push_back({q, p});
  return input;
}

inline double organ_size(const Model& model) { return bounding_box(model.organ.surface.vertices).diagonal(); }

}  // namespace palpate
