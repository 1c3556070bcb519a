// Unilateral contact against CalculiX's: a cube of 10 cm, base fixed, and a rigid sphere of 3 cm radius, 24 x
// 64 facets, pressed 5 mm into the middle of its top. Same tetrahedra, same facets.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <memory>
#include <numbers>

#include "palpate/compliance/blas.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/geometry/signed_distance.hpp"
#include "palpate/lattice/lattice.hpp"
#include "palpate/simulation/model.hpp"
#include "support/calculix.hpp"
#include "support/validation_table.hpp"

namespace palpate::test {
namespace {

const bool blas_is_set_up = (set_up_blas(), true);
constexpr double depth = 0.005;
const std::vector<Material> materials{{10e3, 0.45}};
const std::vector<Anchor> anchors{AnchorHalfSpace{Vec3::Zero(), Vec3::UnitZ()}};

TetMesh cube(int cells) {
  return make_block({Vec3(-0.05, -0.05, 0), Vec3(0.05, 0.05, 0.1)}, {cells, cells, cells});
}

// About its centre, turned about the z axis by a part of a segment.
TriangleMesh sphere(double turn) {
  TriangleMesh tool = make_sphere(Vec3::Zero(), 0.03, 24, 64);
  const Mat3 r = Eigen::AngleAxisd(turn * 2 * std::numbers::pi / 64, Vec3::UnitZ()).toRotationMatrix();
  for (Vec3& p : tool.vertices) p = r * p;
  return tool;
}

struct Pressed {
  std::vector<Vec3> displacement;  // of the mesh's nodes; zero inside
  Vec3 force;                      // on the tool, N
};

// Ours: lattice of 0.12 mm about the lower cap, the only part that comes near the cube.
Pressed press(int cells, const TriangleMesh& tool) {
  Model model;
  model.organ = bake(cube(cells), materials, anchors, 0, {}, nullptr, {.order = 1, .pinch = false});
  const Box cap{Vec3(-0.017, -0.017, -0.0305), Vec3(0.017, 0.017, -0.020)};
  const LatticeSamples samples = sample_lattice(SignedDistanceField(tool), make_grid_spaced(cap, 0.12e-3));
  model.instruments.push_back({"sphere", std::make_shared<const Lattice>(samples), tool});
  State state = make_state(model);
  Input input;
  input.instruments.resize(1);
  for (int tick = 1; tick <= 10; ++tick) {
    input.instruments[0].translation = Vec3(0, 0, 0.13 - depth * tick / 10);
    step(model, state, input);
    EXPECT_EQ(state.status & ~strain_beyond_linear, 0u) << tick;
  }
  Pressed result{std::vector<Vec3>(model.organ.mesh.nodes.size(), Vec3::Zero()), state.wrenches[0].force};
  for (std::size_t i = 0; i < model.organ.surface_size(); ++i)
    result.displacement[static_cast<std::size_t>(model.organ.surface_nodes[i])] =
        state.surface.displacement[i].cast<double>();
  return result;
}

std::optional<ContactReference> reference(int cells, TriangleMesh tool) {
  for (Vec3& p : tool.vertices) p.z() += 0.13;
  const TetMesh mesh = cube(cells);
  return calculix_contact(mesh, materials, anchored_nodes(mesh, anchors), tool, Vec3(0, 0, -depth));
}

void compare(int cells, double turn, bool displacements) {
  const auto theirs = reference(cells, sphere(turn));
  if (!theirs) GTEST_SKIP() << no_calculix;
  const Pressed ours = press(cells, sphere(turn));
  const TetMesh mesh = cube(cells);
  double largest = 0, difference = 0;
  std::size_t corner = 0;
  for (const Index v : boundary(mesh).nodes) {
    const auto i = static_cast<std::size_t>(v);
    largest = std::max(largest, theirs->displacement[i].norm());
    difference = std::max(difference, (ours.displacement[i] - theirs->displacement[i]).norm());
    if ((mesh.nodes[i] - Vec3(0.05, 0.05, 0.1)).norm() < 1e-9) corner = i;
  }
  const double u = 1e3 * ours.displacement[corner].z(), v = 1e3 * theirs->displacement[corner].z();
  const double force = ours.force.z(), their_force = theirs->force.z();
  std::printf(
      "%zu nodes, sphere turned by %.1f segments: force %.4f N, CalculiX %.4f (%.1e); corner u_z %.4f mm, "
      "CalculiX "
      "%.4f; displacements differ by %.1e of the largest; CalculiX took %.1f s\n",
      mesh.nodes.size(), turn, force, their_force, std::abs(force / their_force - 1), u, v,
      difference / largest, theirs->seconds);
  validation_row("calculix_contact",
                 "nodes,turn_segments,force_N,calculix_force_N,corner_uz_mm,calculix_corner_uz_mm,"
                 "difference_over_largest,calculix_s",
                 fmt::format("{},{},{:.5f},{:.5f},{:.5f},{:.5f},{:.2e},{:.1f}", mesh.nodes.size(), turn,
                             force, their_force, u, v, difference / largest, theirs->seconds));
  EXPECT_NEAR(force, their_force, 1e-3 * their_force);
  if (!displacements) return;
  EXPECT_NEAR(u, v, 0.01 * std::abs(v));
  EXPECT_LT(difference, 0.003 * largest);
}

// Turned by half a segment: every node near the middle touches a facet's interior, and the solution is
// unique.
TEST(ContactCalculix, ForceAndDisplacements1000Nodes) { compare(9, 0.5, true); }
TEST(ContactCalculix, ForceAndDisplacements2744Nodes) { compare(13, 0.5, true); }

// As made, the four nodes of the middle touch ridges between facets. Each may come to rest on either side:
// there are several solutions with nearly the same force, and the corners differ by a few per cent between
// them.
TEST(ContactCalculix, ForceOnRidges1000Nodes) { compare(9, 0, false); }
TEST(ContactCalculix, ForceOnRidges2744Nodes) { compare(13, 0, false); }

}  // namespace
}  // namespace palpate::test
