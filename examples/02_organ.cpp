// A soft organ: a surface becomes tetrahedra, tetrahedra become a compliance, a ball presses it.
#include <cstdio>

#include "palpate/compliance/blas.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/pad/pad.hpp"
#include "palpate/simulation/model.hpp"

using namespace palpate;

int main() try {
  set_up_blas();  // first thing, before any thread

  // 1. A kidney with a stone, padded with tetrahedra.
  const Padded padded = pad_delaunay(make_kidney(492), {{"stone", make_stone(42)}});
  std::printf("%zu nodes, %zu tetrahedra, smallest dihedral angle %.1f degrees\n", padded.mesh.nodes.size(),
              padded.mesh.tets.size(), padded.report.quality.min_dihedral);

  // 2. A material for each region, in the regions' order: Young's modulus (Pa) and Poisson's ratio.
  std::vector<Material> materials;
  for (const std::string& region : padded.mesh.region_names)
    materials.push_back(region == "stone" ? Material{1e9, 0.3} : Material{10e3, 0.45});

  // 3. Its back is held (nodes below z = -15 mm), and the compliance between its surface nodes computed.
  Model model;
  model.organ = bake(padded.mesh, materials, {AnchorHalfSpace{{0, 0, -0.015}, {0, 0, 1}}});
  std::printf("%zu of %zu surface nodes are free, compliance of %zu bytes\n", model.organ.compliance.nodes(),
              model.organ.surface_size(), model.organ.compliance.bytes());

  // 4. A ball of 10 mm radius comes down on the highest node. Poses in; forces and displacements out.
  model.instruments.push_back({"ball", Sphere{0.010}, {}});
  Vec3 top = model.organ.surface.vertices[0];
  for (const Vec3& v : model.organ.surface.vertices)
    if (v.z() > top.z()) top = v;
  State state = make_state(model);
  for (const double depth : {0.0, 0.002, 0.004, 0.006}) {
    Input input;
    input.instruments = {Pose{Eigen::Quaterniond::Identity(), top + Vec3(0, 0, 0.010 - depth)}};
    step(model, state, input);
    std::printf("%.0f mm deep: %2zu nodes touch, %.3f N push the ball up, status %u\n", 1e3 * depth,
                state.contacts.size(), state.wrenches[0].force.z(), state.status);
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
