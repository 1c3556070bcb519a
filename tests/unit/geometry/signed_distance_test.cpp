#include "palpate/geometry/signed_distance.hpp"

#include <gtest/gtest.h>

#include <random>

#include "meshes.hpp"
#include "palpate/base/error.hpp"
#include "palpate/geometry/check.hpp"
#include "palpate/geometry/crossing.hpp"
#include "palpate/geometry/shapes.hpp"

namespace palpate {
namespace {

using test::both, test::cube, test::flipped, test::torus;

Vec3 random_point(std::mt19937_64& random, double r) {
  std::uniform_real_distribution<double> u(-r, r);
  const double x = u(random), y = u(random), z = u(random);
  return {x, y, z};
}

TEST(Check, CountsWhatIsWrong) {
  TriangleMesh mesh = both(cube(Vec3::Zero(), 1), torus(5, 1, 12, 8));
  MeshReport r = check(mesh);
  EXPECT_TRUE(r.closed() && r.oriented());
  EXPECT_EQ(r.components, 2u);
  EXPECT_LT(r.area_sum.norm(), 1e-12);
  EXPECT_GT(r.volume, 8);
  std::swap(mesh.triangles[0][0], mesh.triangles[0][1]);
  EXPECT_EQ(check(mesh).flipped_edges, 3u);
  mesh.triangles.push_back(mesh.triangles[0]);
  r = check(mesh);
  EXPECT_EQ(r.duplicate_triangles, 1u);
  EXPECT_EQ(r.nonmanifold_edges, 3u);
  mesh.triangles.erase(mesh.triangles.begin() + 20);
  EXPECT_EQ(check(mesh).open_edges, 3u);
  EXPECT_FALSE(check(TriangleMesh{}).closed());
}

TEST(WindingNumber, OfAClosedSurfaceIsOneInsideAndNoughtOutside) {
  std::mt19937_64 random(3);
  const TriangleMesh mesh = torus(1, 0.4, 60, 30);
  const WindingNumber fast(mesh);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p = random_point(random, 1.5);
    const double exact = winding_number(mesh, p);
    EXPECT_NEAR(exact, std::round(exact), 1e-9);
    const double ring = std::hypot(std::hypot(p.x(), p.y()) - 1, p.z());
    if (std::abs(ring - 0.4) > 0.02) {
      EXPECT_NEAR(exact, ring < 0.4 ? 1 : 0, 1e-9);
    }
    EXPECT_NEAR(fast.at(p), exact, 0.02);
  }
}

TEST(WindingNumber, FastConvergesToExactOnSoups) {
  std::mt19937_64 random(5);
  const TriangleMesh mesh = test::soup(3000, 4);
  double worst2 = 0, worst4 = 0, worst8 = 0;
  const WindingNumber two(mesh, 2), four(mesh, 4), eight(mesh, 8);
  for (int i = 0; i < 500; ++i) {
    const Vec3 p = random_point(random, 3);
    const double exact = winding_number(mesh, p);
    worst2 = std::max(worst2, std::abs(two.at(p) - exact));
    worst4 = std::max(worst4, std::abs(four.at(p) - exact));
    worst8 = std::max(worst8, std::abs(eight.at(p) - exact));
  }
  // Third order in 1 / accuracy: a wrong coefficient makes it first or second.
  EXPECT_LT(worst2, 0.01);
  EXPECT_LT(worst4, worst2 / 5);
  EXPECT_LT(worst8, worst4 / 5);
}

// One expansion of everything, seen from ever farther: the error falls as the fifth power of the distance. A
// wrong coefficient of second order makes that the fourth.
TEST(WindingNumber, ExpansionIsOfSecondOrder) {
  const TriangleMesh mesh = test::soup(200, 12);
  const WindingNumber fast(mesh, 1);
  std::mt19937_64 random(5);
  double near = 0, far = 0;
  for (int i = 0; i < 200; ++i) {
    const Vec3 direction = random_point(random, 1).normalized();
    const auto error = [&](double r) {
      return std::abs(fast.at(r * direction) - winding_number(mesh, r * direction));
    };
    near = std::max(near, error(20));
    far = std::max(far, error(60));
  }
  EXPECT_GT(near / far, 180);  // 3^5 = 243, 3^4 = 81
}

// Everywhere the sign must be that of the exact winding number.
void expect_signs(const TriangleMesh& mesh, SignMethod method, double size) {
  const SignedDistanceField field(mesh);
  EXPECT_EQ(field.method(), method) << field.reason();
  std::mt19937_64 random(9);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p = random_point(random, size);
    const SignedDistance s = field.at(p);
    EXPECT_EQ(s.distance<0, winding_number(mesh, p)> 0.5) << p.transpose();
    EXPECT_EQ(field.inside(p), s.distance < 0);
    EXPECT_NEAR(s.normal.norm(), 1, 1e-12);
    EXPECT_NEAR((p - s.point).norm(), std::abs(s.distance), 1e-12);
  }
}

TEST(SignedDistance, SignIsTheWindingNumbers) {
  expect_signs(torus(1, 0.4, 31, 17), SignMethod::pseudonormal, 1.6);
  expect_signs(test::soup(500, 6), SignMethod::winding, 1.2);
}

TEST(SignedDistance, AnInnerPartFacingInwardsIsACavityOneFacingOutwardsIsSolid) {
  const TriangleMesh outer = cube(Vec3::Zero(), 1), inner = cube(Vec3(0.1, 0, 0), 0.5);
  expect_signs(both(outer, flipped(inner)), SignMethod::pseudonormal, 1.3);
  expect_signs(both(outer, inner), SignMethod::winding, 1.3);
  EXPECT_FALSE(SignedDistanceField(both(outer, flipped(inner))).inside(Vec3(0.1, 0, 0)));
  EXPECT_TRUE(SignedDistanceField(both(outer, inner)).inside(Vec3(0.1, 0, 0)));
  EXPECT_TRUE(SignedDistanceField(both(outer, inner)).inside(Vec3(0.7, 0, 0)));
}

TEST(SignedDistance, OverlappingPartsAreUnited) {
  expect_signs(both(cube(Vec3::Zero(), 1), cube(Vec3(0.5, 0.4, 0.3), 1)), SignMethod::winding, 2);
}

TEST(Crossing, FindsWhatPiercesTouchesOrOverlapsInOnePlane) {
  const auto crosses = [](const TriangleMesh& mesh) { return crosses_itself(mesh, Bvh(mesh)); };
  const TriangleMesh one = cube(Vec3::Zero(), 1);
  EXPECT_FALSE(crosses(one));
  EXPECT_FALSE(crosses(torus(1, 0.4, 40, 20)));
  EXPECT_FALSE(crosses(make_box({Vec3::Zero(), Vec3(1, 2, 3)}, 5)));  // many triangles in one plane
  EXPECT_FALSE(crosses(make_kidney(1000)));
  EXPECT_FALSE(crosses(both(one, cube(Vec3::Zero(), 0.5))));
  EXPECT_FALSE(crosses(both(one, cube(Vec3(2.0001, 0, 0), 1))));
  EXPECT_TRUE(crosses(both(one, cube(Vec3(0.5, 0.4, 0.3), 1))));
  EXPECT_TRUE(crosses(both(one, cube(Vec3(1.5, 0, 0), 0.5))));           // a face within a face
  EXPECT_TRUE(crosses(both(one, cube(Vec3(2, 0.3, 0.2), 1))));           // faces that overlap
  EXPECT_TRUE(crosses(both(one, cube(Vec3(0, 0, 1.0), 0.01))));          // a small one in a face
  EXPECT_TRUE(crosses(both(one, cube(Vec3(1.001, 1.001, 0.5), 0.01))));  // on an edge
}

// A spike from a box's bottom through its top: the centres of all triangles see nothing of it, and edges meet
// edges only.
TEST(SignedDistance, ASmallCrossingIsNotMissed) {
  TriangleMesh mesh = make_box({Vec3(-1, -1, -1), Vec3(1, 1, 1)}, 6);
  int moved = 0;
  for (Vec3& v : mesh.vertices)
    if ((v - Vec3(0, 0, -1)).norm() < 1e-9) v.z() = 1.01, ++moved;
  ASSERT_EQ(moved, 1);
  EXPECT_EQ(SignedDistanceField(mesh).method(), SignMethod::winding);
}

TEST(SignedDistance, SurfacesFacingInwardsAreTurnedOver) {
  const TriangleMesh mesh = torus(1, 0.4, 24, 12);
  const SignedDistanceField right(mesh), wrong(flipped(mesh));
  EXPECT_FALSE(right.flipped());
  EXPECT_TRUE(wrong.flipped());
  std::mt19937_64 random(1);
  for (int i = 0; i < 500; ++i) {
    const Vec3 p = random_point(random, 1.5);
    EXPECT_EQ(right.at(p).distance, wrong.at(p).distance);
  }
  // One of two apart faces inwards; the other way round the volume is negative.
  for (const double r : {0.5, 2.0}) {
    const TriangleMesh two = both(cube(Vec3::Zero(), 1), flipped(cube(Vec3(5, 0, 0), r)));
    const SignedDistanceField field(two);
    EXPECT_EQ(field.method(), SignMethod::pseudonormal);
    EXPECT_EQ(field.flipped_parts(), 1u);
    EXPECT_TRUE(field.inside(Vec3(0, 0, 0)));
    EXPECT_TRUE(field.inside(Vec3(5, 0, 0)));
    EXPECT_FALSE(field.inside(Vec3(0, 3, 0)));
  }
}

TEST(SignedDistance, DuplicatesChangeNothing) {
  const TriangleMesh mesh = torus(1, 0.4, 24, 12);
  TriangleMesh dirty = mesh;
  for (std::size_t i = 0; i < mesh.triangles.size(); i += 2) {
    dirty.triangles.push_back(mesh.triangles[i]);
    if (i % 4 == 0) std::swap(dirty.triangles.back()[0], dirty.triangles.back()[1]);
  }
  const SignedDistanceField clean(mesh), field(dirty);
  EXPECT_EQ(field.method(), SignMethod::pseudonormal);
  std::mt19937_64 random(1);
  for (int i = 0; i < 500; ++i) {
    const Vec3 p = random_point(random, 1.5);
    EXPECT_EQ(clean.at(p).distance, field.at(p).distance);
  }
}

TEST(SignedDistance, OpenSurfaceFarFromItsHoles) {
  const TriangleMesh whole = torus(1, 0.4, 80, 40);
  for (const bool inwards : {false, true}) {
    TriangleMesh open = whole;
    open.triangles.erase(open.triangles.begin(), open.triangles.begin() + 20);  // a patch at x = 1
    for (std::size_t i = 300; i < open.triangles.size(); i += 200)
      std::swap(open.triangles[i][0], open.triangles[i][1]);
    if (inwards) open = flipped(open);
    const SignedDistanceField exact(whole), field(open);
    EXPECT_EQ(field.method(), SignMethod::winding);
    EXPECT_EQ(field.flipped(), inwards);
    std::mt19937_64 random(2);
    for (int i = 0; i < 3000; ++i) {
      const Vec3 p = random_point(random, 1.5);
      if ((p - Vec3(1.2, 0, 0)).norm() < 0.6 || std::abs(exact.at(p).distance) < 0.05) continue;
      EXPECT_EQ(field.at(p).distance < 0, exact.at(p).distance < 0) << p.transpose();
    }
  }
}

TEST(SignedDistance, NoAnswerIsNoCrash) {
  const SignedDistanceField field(cube(Vec3::Zero(), 1));
  EXPECT_TRUE(std::isinf(field.at(Vec3(5, 0, 0), 1.0).distance));
  EXPECT_TRUE(std::isnan(field.at(Vec3(std::nan(""), 0, 0)).distance));
  EXPECT_EQ(field.at(Vec3(1, 0, 0)).distance, 0);
  EXPECT_EQ(field.at(Vec3(1, 0.3, 0.2)).normal, Vec3(1, 0, 0));
  EXPECT_NEAR((field.at(Vec3(1, 1, 0.2)).normal - Vec3(1, 1, 0).normalized()).norm(), 0, 1e-15);
  EXPECT_NEAR((field.at(Vec3(1, -1, 1)).normal - Vec3(1, -1, 1).normalized()).norm(), 0, 1e-15);
  EXPECT_THROW(SignedDistanceField(TriangleMesh{}), Error);
  TriangleMesh bad = cube(Vec3::Zero(), 1);
  bad.triangles[3][1] = 8;
  EXPECT_THROW(SignedDistanceField{bad}, Error);
  bad = cube(Vec3(std::nan(""), 0, 0), 1);
  EXPECT_THROW(SignedDistanceField{bad}, Error);
}

}  // namespace
}  // namespace palpate
