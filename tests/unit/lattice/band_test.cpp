#include <cmath>
#include <fstream>

#include "lattice_test.hpp"
#include "palpate/base/error.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/lattice/band_lattice.hpp"
#include "palpate/lattice/lattice_file.hpp"

namespace palpate {
namespace {

struct Case {
  TriangleMesh mesh;
  int subdivisions;
};

std::vector<Case> cases() {
  TriangleMesh nested = make_sphere(Vec3::Zero(), 1, 20, 40);  // with a cavity
  for (const Triangle& t : make_sphere(Vec3::Zero(), 0.6, 20, 40).triangles)
    nested.triangles.push_back({t[0] + static_cast<Index>(nested.vertices.size()),
                                t[2] + static_cast<Index>(nested.vertices.size()),
                                t[1] + static_cast<Index>(nested.vertices.size())});
  for (const Vec3& p : make_sphere(Vec3::Zero(), 0.6, 20, 40).vertices) nested.vertices.push_back(p);
  return {{test::torus(1, 0.4, 60, 30), 30},
          {test::cube(Vec3(0.1, 0.2, 0.3), 1), 60},
          {make_box({Vec3(0, 0, 0), Vec3(1, 1, 0.04)}), 3},  // thinner than a brick
          {nested, 90}};
}

TEST(BandLattice, InTheBandAsTheWholeLattice) {
  for (const Case& c : cases()) {
    const SignedDistanceField field(c.mesh);
    const Grid grid = make_grid(test::box_of(c.mesh), c.subdivisions, 0.1);
    const double band = 3 * grid.h;
    const Lattice whole(sample_lattice(field, grid, 1));
    const BandSamples samples = sample_band(field, grid, band, 1);
    const BandLattice lattice(samples);
    std::mt19937_64 random(1);
    int found = 0;
    for (int i = 0; i < 40000; ++i) {
      const Vec3 p = test::random_in(grid.box(), random);
      if (std::abs(field.at(p).distance) > band) continue;
      ++found;
      ASSERT_EQ(lattice.distance(p), lattice.sample(p).distance);
      ASSERT_NEAR(lattice.distance(p), whole.distance(p), 1e-7);
      ASSERT_NEAR(lattice.smooth(p).distance, whole.smooth(p).distance, 1e-7);
      ASSERT_NEAR((lattice.smooth(p).gradient - whole.smooth(p).gradient).norm(), 0, 1e-5);
      ASSERT_NEAR((lattice.sample(p).gradient - whole.sample(p).gradient).norm(), 0, 1e-5);
      ASSERT_EQ(lattice.closest(p).has_value(), whole.closest(p).has_value());
      if (const auto q = lattice.closest(p)) {
        ASSERT_NEAR((*q - *whole.closest(p)).norm(), 0, 1e-6);
      }
    }
    EXPECT_GT(found, 2000);
    if (c.subdivisions > 80) {
      EXPECT_LT(samples.distance.size(), grid.size()) << "no saving";
    }
  }
}

// With the right sign and never more than the true distance, in the grid and beyond.
TEST(BandLattice, ALowerBoundElsewhere) {
  for (const Case& c : cases()) {
    const SignedDistanceField field(c.mesh);
    const Grid grid = make_grid(test::box_of(c.mesh), c.subdivisions, 1.5);
    const double band = 2 * grid.h;
    const BandLattice lattice(sample_band(field, grid, band, 1));
    std::mt19937_64 random(2);
    int far = 0;
    for (int i = 0; i < 40000; ++i) {
      const Vec3 p = test::random_in(grid.box().grown(i % 4 == 0 ? 2 : 0), random);
      const double exact = field.at(p).distance,
                   s = (p - p.cwiseMax(grid.box().min).cwiseMin(grid.box().max)).norm();
      if (std::abs(exact) <= band + 14 * grid.h || (s > 0 && s < grid.h)) continue;
      ++far;
      for (const LatticeSample& d : {lattice.sample(p), s > 0 ? lattice.sample(p) : lattice.smooth(p)}) {
        ASSERT_LE(std::abs(d.distance), std::abs(exact) * (1 + 1e-6)) << p.transpose();
        ASSERT_EQ(d.distance < 0, exact < 0);
        ASSERT_GE(std::abs(d.distance), (s > 0 ? 0.5 : 1) * std::abs(exact) - 3 * brick * grid.h)
            << "useless";
        ASSERT_NEAR(d.gradient.norm(), 1, s > 0 ? 1e-6 : 0.2);
      }
    }
    EXPECT_GT(far, 1000);
  }
}

TEST(BandLattice, NothingIsTooFarNorHasTheWrongSign) {  // between band and bricks' ends, too
  const Case c = cases()[0];
  const SignedDistanceField field(c.mesh);
  const Grid grid = make_grid(test::box_of(c.mesh), c.subdivisions, 0.5);
  const BandLattice lattice(sample_band(field, grid, grid.h, 1));
  std::mt19937_64 random(3);
  for (int i = 0; i < 100000; ++i) {
    const Vec3 p = test::random_in(grid.box(), random);
    const double exact = field.at(p).distance, d = lattice.distance(p);
    ASSERT_LE(std::abs(d), std::abs(exact) + 0.45 * grid.h);  // the interpolation's error
    if (std::abs(exact) > 0.45 * grid.h) {
      ASSERT_EQ(d < 0, exact < 0);
    }
  }
}

TEST(BandLattice, TheSameBitsForAnyThreads) {
  const SignedDistanceField field(test::torus(1, 0.4, 60, 30));
  const Grid grid = make_grid(test::box_of(test::torus(1, 0.4, 60, 30)), 20, 0.1);
  const BandSamples one = sample_band(field, grid, 3 * grid.h, 1),
                    two = sample_band(field, grid, 3 * grid.h, 2);
  EXPECT_EQ(one.slot, two.slot);
  EXPECT_EQ(one.center, two.center);
  EXPECT_EQ(one.distance, two.distance);
  EXPECT_EQ(one.closest, two.closest);
  EXPECT_EQ(one.gradient, two.gradient);
}

TEST(BandLattice, AnyNumberIsAnswered) {
  const TriangleMesh mesh = test::cube(Vec3::Zero(), 1);
  const BandLattice lattice(
      sample_band(SignedDistanceField(mesh), make_grid(test::box_of(mesh), 40, 0.5), 0.1, 1));
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(std::isnan(lattice.distance(Vec3(nan, 0, 0))));
  EXPECT_TRUE(std::isnan(lattice.smooth(Vec3(0, nan, 0)).distance));
  EXPECT_EQ(lattice.distance(Vec3(inf, 0, 0)), inf);
  EXPECT_GE(lattice.distance(Vec3(1e300, 0, 0)), 1e299);
  EXPECT_FALSE(lattice.closest(Vec3(nan, inf, 0)));
}

TEST(BandLattice, FilesThereAndBack) {
  const TriangleMesh mesh = test::torus(1, 0.4, 40, 20);
  const Grid grid = make_grid(test::box_of(mesh), 12, 0.1);
  const BandSamples s = sample_band(SignedDistanceField(mesh), grid, 2 * grid.h, 1);
  const std::filesystem::path path = std::filesystem::temp_directory_path() / "palpate_band_test.h5";
  write_band(path, s, mesh, "a torus");
  EXPECT_TRUE(is_band_file(path));
  const BandFile file = read_band(path);
  EXPECT_EQ(file.samples.grid.n, grid.n);
  EXPECT_EQ(file.samples.band, s.band);
  EXPECT_EQ(file.samples.slot, s.slot);
  EXPECT_EQ(file.samples.center, s.center);
  EXPECT_EQ(file.samples.distance, s.distance);
  EXPECT_EQ(file.samples.closest, s.closest);
  EXPECT_EQ(file.samples.gradient, s.gradient);
  EXPECT_EQ(file.surface.triangles, mesh.triangles);
  EXPECT_EQ(file.provenance, "a torus");
  EXPECT_THROW(read_lattice(path), Error);
  const std::string bytes = read_file(path);
  for (std::size_t length = 0; length < bytes.size(); length += bytes.size() / 37 + 1) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes.substr(0, length);
    EXPECT_THROW(read_band(path), Error) << length;
  }
  BandSamples wrong = s;
  std::swap(wrong.slot.front(), *std::max_element(wrong.slot.begin(), wrong.slot.end()));
  write_band(path, wrong, mesh, "");
  EXPECT_THROW(read_band(path), Error);
  std::filesystem::remove(path);
}

TEST(BandLattice, RefusesABandOfNothing) {
  const TriangleMesh mesh = test::cube(Vec3::Zero(), 1);
  const SignedDistanceField field(mesh);
  const Grid grid = make_grid(test::box_of(mesh), 10);
  EXPECT_THROW(sample_band(field, grid, 0.5 * grid.h), Error);
  EXPECT_THROW(sample_band(field, grid, std::nan("")), Error);
  const Grid huge = make_grid_spaced(test::box_of(mesh), 1e-5);
  try {
    sample_band(field, huge, 3e-5);
    FAIL() << "there is no such memory";
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::resource);
    EXPECT_NE(std::string(e.what()).find("larger spacing"), std::string::npos);
  }
  std::atomic<bool> stop = true;
  EXPECT_THROW(sample_band(field, grid, grid.h, 1, {nullptr, &stop}), Error);
}

}  // namespace
}  // namespace palpate
