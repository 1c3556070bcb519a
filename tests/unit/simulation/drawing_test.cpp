#include "palpate/simulation/drawing.hpp"

#include <gtest/gtest.h>

#include "fixtures.hpp"
#include "palpate/base/error.hpp"
#include "unit/io/io_test.hpp"

namespace palpate {
namespace {

// Twice as fine as a block of n cells, and a little off its surface.
TriangleMesh finer(int n) {
  TriangleMesh mesh =
      boundary(make_block({Vec3(-0.0504, -0.0504, 0), Vec3(0.0504, 0.0504, 0.1003)}, {2 * n, 2 * n, 2 * n}))
          .surface;
  return mesh;
}

std::vector<Vec3> drawn(const Drawing& drawing, const TriangleMesh& organ, const std::vector<Vec3>& nodes) {
  std::vector<Vec3> out(drawing.surface.vertices.size());
  draw(drawing, organ, nodes, out);
  return out;
}

double farthest(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, (a[i] - b[i]).norm());
  return most;
}

TEST(Drawing, RidesAlong) {
  const TriangleMesh organ = make_kidney(300);
  const TriangleMesh fine = make_kidney(3000);
  const Drawing drawing = embed(fine, organ);
  EXPECT_LT(farthest(drawn(drawing, organ, organ.vertices), fine.vertices), 1e-8);
  const Pose pose{Eigen::Quaterniond(Eigen::AngleAxisd(1.2, Vec3(1, 2, 3).normalized())),
                  Vec3(0.1, -0.2, 0.3)};
  std::vector<Vec3> moved = organ.vertices, expected = fine.vertices;
  for (Vec3& p : moved) p = pose * p;
  for (Vec3& p : expected) p = pose * p;
  EXPECT_LT(farthest(drawn(drawing, organ, moved), expected), 1e-7);
  // Pressed flat there are no normals, but numbers.
  for (Vec3& p : moved) p = Vec3::Ones();
  for (const Vec3& p : drawn(drawing, organ, moved)) EXPECT_TRUE(p.allFinite());
}

TEST(Drawing, SurfacesOfOtherOrgansAreRefused) {
  const TriangleMesh organ = make_kidney(300);
  TriangleMesh millimetres = organ;
  for (Vec3& p : millimetres.vertices) p *= 1000;
  EXPECT_THROW(embed(millimetres, organ), Error);
  EXPECT_THROW(embed({}, organ), Error);
}

// Of linear tetrahedra the surface's displacement is the elements' own; of quadratic ones the drawn nodes are
// projected from means, and sides curve.
TEST(Drawing, ErrorAgainstTheElements) {
  const TriangleMesh own = block_organ(6).surface;
  EXPECT_LT(block_organ(6, {.order = 1, .drawing = own}).drawing.error_max, 1e-4);
  const Drawing coarse = block_organ(4, {.order = 2, .drawing = finer(4)}).drawing,
                fine = block_organ(8, {.order = 2, .drawing = finer(4)}).drawing;
  EXPECT_GT(coarse.error_rms, 1e-4);
  EXPECT_GT(coarse.error_max, coarse.error_rms);
  EXPECT_LT(fine.error_rms, 0.5 * coarse.error_rms);
  EXPECT_LT(fine.error_max, 0.2);
}

TEST(Drawing, IsInTheModelFileAndInWhatIsDrawn) {
  const TempFolder folder;
  Model model;
  model.organ = block_organ(8, {.order = 2, .drawing = finer(8)});
  write_organ(folder / "a.h5", model.organ, "test");
  const Organ back = read_organ(folder / "a.h5");
  EXPECT_EQ(back.drawing.surface.vertices, model.organ.drawing.surface.vertices);
  EXPECT_EQ(back.drawing.surface.triangles, model.organ.drawing.surface.triangles);
  EXPECT_EQ(back.drawing.triangle, model.organ.drawing.triangle);
  EXPECT_EQ(back.drawing.error_rms, model.organ.drawing.error_rms);
  EXPECT_EQ(back.discretisation.stiffness, model.organ.discretisation.stiffness);
  EXPECT_EQ(back.discretisation.at, model.organ.discretisation.at);

  model.instruments.push_back({"tool", Sphere{0.02}, surface_of_primitive(Sphere{0.02})});
  State state = make_state(model);
  step(model, state, at(Vec3(0, 0, 0.115)));
  const std::vector<Vec3> shown = drawn_vertices(model, state);
  const TriangleMesh& mesh = drawn_surface(model.organ);
  ASSERT_EQ(shown.size(), mesh.vertices.size());
  double lowest = 0;
  for (std::size_t i = 0; i < shown.size(); ++i) lowest = std::min(lowest, (shown[i] - mesh.vertices[i]).z());
  EXPECT_LT(lowest, -0.003);
  EXPECT_GT(lowest, -0.009);  // means over hats of 12.5 mm touch the ball, its tip lies deeper
}

}  // namespace
}  // namespace palpate
