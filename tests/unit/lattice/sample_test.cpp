// The grid's own values.
#include <algorithm>
#include <numeric>

#include "lattice_test.hpp"
#include "palpate/base/error.hpp"
#include "palpate/geometry/shapes.hpp"

namespace palpate {
namespace {

using test::box_of, test::sampled;

struct Named {
  std::string name;
  TriangleMesh mesh;
};

std::vector<Named> meshes() {
  std::vector<Named> all{
      {"torus", test::torus(0.06, 0.02, 36, 16)},
      {"cube", test::cube(Vec3(0.3, -0.2, 0.1), 0.7)},
      {"cavity", test::both(test::cube(Vec3::Zero(), 1), test::flipped(test::cube(Vec3(0.1, 0, 0), 0.5)))},
      {"overlap", test::both(test::cube(Vec3::Zero(), 1), test::cube(Vec3(0.5, 0.4, 0.3), 1))},
      {"soup", test::soup(300, 8)}};
  for (const char* file : {"torus.iv", "chess/bishop.iv"})
    if (std::filesystem::exists(test::inventor / file))
      all.push_back({file, read_surface(test::inventor / file).mesh});
  return all;
}

TEST(Lattice, EqualsBruteForce) {
  for (const auto& [name, mesh] : meshes()) {
    const SignedDistanceField field(mesh);
    const Grid grid = make_grid(box_of(mesh), mesh.triangles.size() > 500 ? 4 : 7, 0.01);
    const LatticeSamples samples = sample_lattice(field, grid, 2);
    EXPECT_EQ(samples.sign, field.method());
    std::size_t number = 0;
    for (int i = 0; i < grid.n[0]; ++i)
      for (int j = 0; j < grid.n[1]; ++j)
        for (int k = 0; k < grid.n[2]; ++k, ++number) {
          const Vec3 p = grid.point(i, j, k);
          double d2 = std::numeric_limits<double>::infinity();
          for (const Triangle& t : mesh.triangles)
            d2 = std::min(d2, closest_on_triangle(p, mesh.vertices[static_cast<std::size_t>(t[0])],
                                                  mesh.vertices[static_cast<std::size_t>(t[1])],
                                                  mesh.vertices[static_cast<std::size_t>(t[2])])
                                  .distance_squared);
          const double d = samples.distance[number];
          ASSERT_NEAR(std::abs(d), std::sqrt(d2), 1e-6 * grid.h) << name;
          ASSERT_NEAR((p - samples.closest[number]).norm(), std::sqrt(d2), 1e-6 * grid.h) << name;
          if (std::abs(d) > 1e-9 * grid.h) {
            ASSERT_EQ(d<0, winding_number(mesh, p) * (field.flipped() ? -1 : 1)> 0.5) << name;
          }
        }
  }
}

// Neighbours differ by no more than their distance; where the sign differs the surface lies between.
TEST(Lattice, IsLipschitzAndChangesSignOnlyAcrossTheSurface) {
  for (const auto& [name, mesh] : meshes()) {
    if (name == "soup") continue;  // open: the sign changes in the open
    const LatticeSamples s = sampled(mesh, 7);
    const Grid& g = s.grid;
    for (int i = 0; i < g.n[0]; ++i)
      for (int j = 0; j < g.n[1]; ++j)
        for (int k = 0; k < g.n[2]; ++k)
          for (const auto& to : {std::array{i + 1, j, k}, std::array{i, j + 1, k}, std::array{i, j, k + 1},
                                 std::array{i + 1, j + 1, k}, std::array{i + 1, j + 1, k + 1}}) {
            if (to[0] >= g.n[0] || to[1] >= g.n[1] || to[2] >= g.n[2]) continue;
            const double a = s.distance[g.number({i, j, k})], b = s.distance[g.number(to)];
            const double apart = (g.point(i, j, k) - g.point(to[0], to[1], to[2])).norm();
            ASSERT_LE(std::abs(a - b), apart * (1 + 1e-9)) << name;
          }
  }
}

// The chess piece of T fig. 6.1 with a tenth of its base's triangles gone, some of the rest turned over: away
// from the base the signs are those of the whole.
TEST(Lattice, OpenSurfaceHasTheSignsOfTheWholeAwayFromItsHoles) {
  const auto path = test::inventor / "chess/bishop.iv";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no inventor-data";
  const TriangleMesh whole = read_surface(path).mesh;
  const Box box = box_of(whole);
  const double height = box.size().y();
  TriangleMesh open = whole;
  std::size_t i = 0;
  std::erase_if(open.triangles, [&](const Triangle& t) {
    const double y = whole.vertices[static_cast<std::size_t>(t[0])].y();
    return y < box.min.y() + 0.2 * height && i++ % 10 == 0;
  });
  ASSERT_LT(open.triangles.size(), whole.triangles.size());
  for (std::size_t k = 0; k < open.triangles.size(); k += 50)
    std::swap(open.triangles[k][0], open.triangles[k][1]);
  const SignedDistanceField exact(whole), field(open);
  EXPECT_EQ(field.method(), SignMethod::winding);
  std::mt19937_64 random(3);
  int wrong = 0, asked = 0;
  for (int n = 0; n < 5000; ++n) {
    const Vec3 p = test::random_in(box, random);
    const double d = exact.at(p).distance;
    if (p.y() < box.min.y() + 0.4 * height || std::abs(d) < 0.02 * height) continue;
    ++asked;
    wrong += (field.at(p).distance < 0) != (d < 0);
  }
  EXPECT_GT(asked, 1000);
  EXPECT_EQ(wrong, 0);
}

TEST(Lattice, SameBitsForAnyNumberOfThreads) {
  for (const TriangleMesh& mesh : {test::torus(1, 0.4, 50, 30), test::soup(200, 3)}) {
    const SignedDistanceField field(mesh);
    const Grid grid = make_grid(box_of(mesh), 13, 0.1);
    const LatticeSamples one = sample_lattice(field, grid, 1);
    for (const int threads : {2, 7}) {
      const LatticeSamples many = sample_lattice(field, grid, threads);
      EXPECT_EQ(one.distance, many.distance);
      EXPECT_EQ(one.closest, many.closest);
      EXPECT_EQ(one.touching, many.touching);
    }
  }
}

TEST(Lattice, OrderOfTrianglesAndOfTheirCornersChangesNoDistance) {
  for (const auto& [name, mesh] : meshes()) {
    TriangleMesh shuffled = mesh;
    std::mt19937_64 random(4);
    std::shuffle(shuffled.triangles.begin(), shuffled.triangles.end(), random);
    for (std::size_t i = 0; i < shuffled.triangles.size(); i += 2)
      std::rotate(shuffled.triangles[i].begin(), shuffled.triangles[i].begin() + 1,
                  shuffled.triangles[i].end());
    const LatticeSamples a = sampled(mesh, 6), b = sampled(shuffled, 6);
    for (std::size_t i = 0; i < a.distance.size(); ++i)
      ASSERT_NEAR(a.distance[i], b.distance[i], 1e-12 * a.grid.box().diagonal()) << name;
  }
}

TEST(Lattice, MovesAndScalesWithItsSurface) {
  const Pose pose{Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Vec3(1, 2, -0.5).normalized())),
                  Vec3(0.3, -4, 2)};
  for (const auto& [name, mesh] : meshes())
    for (const double scale : {1e-3, 1.0, 1e3}) {
      TriangleMesh moved = mesh;
      for (Vec3& v : moved.vertices) v = scale * (pose * v);
      const SignedDistanceField a(mesh), b(moved);
      EXPECT_EQ(a.method(), b.method()) << name;
      std::mt19937_64 random(6);
      const Box box = box_of(mesh).grown(0.2 * box_of(mesh).diagonal());
      for (int i = 0; i < 500; ++i) {
        const Vec3 p = test::random_in(box, random);
        ASSERT_NEAR(scale * a.at(p).distance, b.at(scale * (pose * p)).distance, 1e-9 * scale) << name;
      }
    }
}

TEST(Grid, CoversTheBoxAndSaysWhatItCannot) {
  const Box box{Vec3(-1, 2, 0), Vec3(1, 2.9, 7)};
  const Grid grid = make_grid(box, 3, 0.05);
  EXPECT_DOUBLE_EQ(grid.h, 0.3);
  EXPECT_NEAR((grid.origin - Vec3(-1.05, 1.95, -0.05)).norm(), 0, 1e-15);
  EXPECT_EQ(grid.n, (std::array<std::int32_t, 3>{8, 5, 25}));
  EXPECT_GE(grid.box().max.x(), 1.05);
  // A side that is a multiple of h gets no cell more.
  EXPECT_EQ(make_grid({Vec3::Zero(), Vec3(0.1, 0.3, 0.7)}, 10).n, (std::array<std::int32_t, 3>{11, 31, 71}));
  EXPECT_EQ(make_grid_spaced(box, 100).n, (std::array<std::int32_t, 3>{2, 2, 2}));
  EXPECT_THROW(make_grid(box, 0), Error);
  EXPECT_THROW(make_grid(box, 3, -1), Error);
  EXPECT_THROW(make_grid_spaced(box, 0), Error);
  EXPECT_THROW(make_grid_spaced(box, std::nan("")), Error);
  EXPECT_THROW(make_grid_spaced(box, 1e-9), Error);
  EXPECT_THROW(make_grid(Box{}, 3), Error);
  EXPECT_THROW(make_grid({Vec3(0, 0, 0), Vec3(1, 1, 0)}, 3), Error);
}

TEST(Lattice, MoreMemoryThanThereIsIsAnErrorNotAnAttempt) {
  const SignedDistanceField field(test::cube(Vec3::Zero(), 1));
  try {
    sample_lattice(field, make_grid_spaced({Vec3::Zero(), Vec3::Ones()}, 1e-5));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::resource) << error.what();
  }
}

TEST(Lattice, StopsWhenInterrupted) {
  const SignedDistanceField field(test::cube(Vec3::Zero(), 1));
  const std::atomic<bool> stop{true};
  Progress progress;
  progress.interrupted = &stop;
  EXPECT_THROW(sample_lattice(field, make_grid(box_of(test::cube(Vec3::Zero(), 1)), 20), 2, progress), Error);
}

TEST(InterpolationError, FallsAsTheSquareOfTheSpacingOnASmoothField) {
  // Outside a small sphere-like body in a large box the distance is smooth.
  const TriangleMesh mesh = test::torus(1, 0.4, 200, 100);
  const SignedDistanceField field(mesh);
  const auto error = [&](int n) {
    LatticeSamples s;
    s = sample_lattice(field, make_grid({Vec3(2, -1, 1), Vec3(4, 1, 3)}, n), 0);
    return estimate_error(field, s, 2000);
  };
  const InterpolationError coarse = error(5), fine = error(10);
  EXPECT_GT(coarse.max, coarse.rms);
  EXPECT_NEAR(coarse.rms / fine.rms, 4, 0.5);
}

}  // namespace
}  // namespace palpate
