#include "palpate/pad/unfold.hpp"

#include <gtest/gtest.h>

#include "palpate/base/error.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/pad/crossings.hpp"
#include "palpate/pad/pad.hpp"

namespace palpate {
namespace {

TEST(Unfold, PullsBackWhatWasPulledThroughAndNothingElse) {
  TriangleMesh mesh = make_star_shaped(Vec3::Zero(), 12, [](const Vec3&) { return 0.05; });
  const TriangleMesh good = mesh;
  mesh.vertices[100] *= -1.2;  // out of the other side
  ASSERT_FALSE(crossings(mesh.vertices, mesh.triangles, 100).empty());
  EXPECT_THROW(pad_delaunay(mesh), Error);
  PadOptions options;
  options.repair = true;
  const Padded padded = pad_delaunay(mesh, {}, options);
  EXPECT_GT(padded.report.repaired.crossings, 0u);
  EXPECT_LT(padded.report.repaired.moved, mesh.vertices.size() / 5);
  EXPECT_EQ(padded.report.missing_triangles, 0u);
  EXPECT_NEAR(padded.report.quality.volume / volume(good), 1, 0.02);
  const Unfolded report = unfold(mesh);
  EXPECT_EQ(report.moved, padded.report.repaired.moved);
  EXPECT_TRUE(crossings(mesh.vertices, mesh.triangles, 100).empty());
  EXPECT_LT((mesh.vertices[100] - good.vertices[100]).norm(), 0.01);
}

TEST(Unfold, LeavesSoundSurfacesAlone) {
  TriangleMesh mesh = make_kidney(200);
  const std::vector<Vec3> before = mesh.vertices;
  const Unfolded report = unfold(mesh);
  EXPECT_EQ(report.crossings, 0u);
  EXPECT_EQ(report.moved, 0u);
  EXPECT_EQ(mesh.vertices, before);
}

TEST(Unfold, PartsThatOverlapWidelyAreAnError) {
  TriangleMesh mesh = make_box({Vec3(0, 0, 0), Vec3(1, 1, 1)}, 1);
  append(mesh, make_box({Vec3(0.2, 0.2, -2), Vec3(0.8, 0.8, 3)}, 1));
  EXPECT_THROW(unfold(mesh), Error);
}

}  // namespace
}  // namespace palpate
