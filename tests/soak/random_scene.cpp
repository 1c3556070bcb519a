#include "soak/random_scene.hpp"

#include <cmath>

#include "palpate/geometry/shapes.hpp"
#include "palpate/geometry/signed_distance.hpp"
#include "palpate/pad/pad.hpp"

namespace palpate::soak {

Vec3 Random::direction() {
  for (;;) {
    const Vec3 v = in_box({Vec3::Constant(-1), Vec3::Constant(1)});
    if (v.norm() > 0.1 && v.norm() < 1) return v.normalized();
  }
}

Pose Random::pose_in(const Box& box) {
  Pose pose;
  pose.rotation = Eigen::AngleAxisd(between(0, 3), direction());
  pose.translation = in_box(box);
  return pose;
}

namespace {

Organ block(int cells, const BakeOptions& options) {
  return bake(make_block({Vec3(-0.05, -0.05, 0), Vec3(0.05, 0.05, 0.1)}, {cells, cells, cells}),
              {{10e3, 0.45, 1000}}, {AnchorHalfSpace{Vec3::Zero(), Vec3::UnitZ()}}, 0, {}, nullptr, options);
}

// A thin plate, held at one end: it bends far.
Organ plate(const BakeOptions& options) {
  return bake(make_block({Vec3(-0.05, -0.02, 0.04), Vec3(0.05, 0.02, 0.05)}, {16, 6, 2}), {{5e3, 0.49, 1000}},
              {AnchorHalfSpace{Vec3(-0.049, 0, 0), Vec3::UnitX()}}, 0, {}, nullptr, options);
}

Organ kidney(const BakeOptions& options) {
  return bake(pad_delaunay(make_kidney(400)).mesh, {{10e3, 0.45, 1050}},
              {AnchorHalfSpace{Vec3(0, 0, -0.016), Vec3::UnitZ()}}, 0, {}, nullptr, options);
}

Shape lattice_of(const TriangleMesh& surface, double h) {
  return std::make_shared<const Lattice>(sample_lattice(
      SignedDistanceField(surface), make_grid_spaced(bounding_box(surface.vertices), h, 2 * h), 1));
}

// Lumpy, hollow, thin or sharp.
Shape random_lattice(Random& random) {
  const double size = random.between(0.008, 0.03);
  TriangleMesh mesh;
  switch (random.below(3)) {
    case 0: {
      const Vec3 a = random.direction(), b = random.direction();
      const double sharp = random.between(2, 12), deep = random.between(-0.4, 0.6);
      mesh = make_star_shaped(Vec3::Zero(), 8, [&](const Vec3& d) {
        return size * (1 + deep * std::sin(sharp * d.dot(a)) * d.dot(b));
      });
      break;
    }
    case 1:
      mesh = make_torus(size, size * random.between(0.2, 0.6), 24, 12);
      break;
    default: {
      const Vec3 half(size, size * random.between(0.1, 1), size * random.between(0.3, 1));
      mesh = make_box({-half, half});
    }
  }
  return lattice_of(mesh, bounding_box(mesh.vertices).size().maxCoeff() / random.between(10, 24));
}

Shape random_shape(Random& random) {
  switch (random.below(7)) {
    case 6:  // a needle
      return Capsule{random.between(0.0002, 0.002), random.between(0.01, 0.05)};
    case 0:
      return Sphere{random.between(0.002, 0.05)};
    case 1:
      return Capsule{random.between(0.001, 0.02), random.between(0, 0.04)};
    case 2:
      return Cuboid{
          Vec3(random.between(0.001, 0.03), random.between(0.001, 0.03), random.between(0.001, 0.03))};
    case 3:
      if (random.once_in(4)) return HalfSpace{};
      [[fallthrough]];
    default:
      return random_lattice(random);
  }
}

}  // namespace

std::vector<Organ> make_organs() {
  std::vector<Organ> organs;
  organs.push_back(block(6, {.order = 1, .pinch = false}));
  organs.push_back(block(5, {.order = 2, .storage = Storage::half, .pinch = false}));
  organs.push_back(
      block(8, {.order = 1, .storage = Storage::hierarchical, .tolerance = 1e-3, .pinch = false}));
  organs.push_back(plate({.order = 2, .pinch = false}));
  organs.push_back(kidney({.order = 2}));
  organs.push_back(kidney({.order = 1, .storage = Storage::factored}));
  return organs;
}

std::vector<Model> random_models(const std::vector<Organ>& organs, Random& random) {
  Model model;
  model.organ = organs[random.below(organs.size())];
  const std::size_t instruments = random.once_in(3) ? 2 + random.below(2) : 1;
  for (std::size_t i = 0; i < instruments; ++i)
    model.instruments.push_back(
        {"tool", random_shape(random), {}, random.once_in(3) ? random.between(0.0005, 0.01) : 0});
  Settings& settings = model.settings;
  const std::size_t mode = random.below(8);  // most of them unilateral
  settings.mode = mode < 5    ? Mode::unilateral
                  : mode == 5 ? Mode::prescribed
                  : mode == 6 ? Mode::gaussian
                              : Mode::imprint;
  if (settings.mode == Mode::unilateral && random.once_in(2)) settings.friction = random.between(0.05, 1.2);
  if (random.once_in(5)) settings.max_contacts = 1 + static_cast<int>(random.below(30));
  settings.max_relinearisations = random.once_in(5) ? 1 + static_cast<int>(random.below(10)) : 50;
  std::vector<Model> models{model};
  for (std::size_t more = random.once_in(3) ? 1 + random.below(2) : 0; more > 0; --more) {
    models.push_back(model);
    models.back().organ = organs[random.below(organs.size())];
  }
  return models;
}

Pose Wanderer::next(Random& random) {
  if (step_ >= steps_) {
    from_ = to_, to_ = random.pose_in(where_);
    if (random.once_in(2)) to_.rotation = from_.rotation;
    step_ = 0, steps_ = random.once_in(4) ? 3 : 20 + static_cast<int>(random.below(150));
  }
  const double t = static_cast<double>(++step_) / steps_;
  return {from_.rotation.slerp(t, to_.rotation),
          from_.translation + t * (to_.translation - from_.translation)};
}

}  // namespace palpate::soak
