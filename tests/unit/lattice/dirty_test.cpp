// Signs on surfaces with holes and spikes: 1 % of the triangles deleted at random, 0.5 % of the vertices
// moved out by a fiftieth of the body's size. The truth is the undamaged surface.
#include <cmath>
#include <cstdlib>

#include "lattice_test.hpp"

namespace palpate {
namespace {

TriangleMesh damaged(const TriangleMesh& mesh, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> normal;
  TriangleMesh bad{mesh.vertices, {}};
  const double length = 0.02 * test::box_of(mesh).diagonal();
  for (Vec3& v : bad.vertices)
    if (unit(random) < 0.005) {
      const double x = normal(random), y = normal(random), z = normal(random);
      v += length * Vec3(x, y, z).normalized();
    }
  for (const Triangle& t : mesh.triangles)
    if (unit(random) >= 0.01) bad.triangles.push_back(t);
  return bad;
}

// Share of the 28 x 28 x 28 points of a cube about the surface with the wrong sign, mean over the seeds.
double wrong_signs(const TriangleMesh& mesh, unsigned seeds) {
  const Box box = test::box_of(mesh);
  const double side = 1.02 * box.size().maxCoeff();
  const Grid grid{box.center() - Vec3::Constant(0.5 * side), side / 27, {28, 28, 28}};
  const LatticeSamples truth = sample_lattice(SignedDistanceField(mesh), grid);
  std::size_t wrong = 0;
  for (unsigned seed = 1; seed <= seeds; ++seed) {
    const SignedDistanceField field(damaged(mesh, seed));
    EXPECT_EQ(field.method(), SignMethod::winding);
    const LatticeSamples s = sample_lattice(field, grid);
    for (std::size_t i = 0; i < grid.size(); ++i) wrong += (s.distance[i] < 0) != (truth.distance[i] < 0);
  }
  return static_cast<double>(wrong) / (seeds * static_cast<double>(grid.size()));
}

// libigl's fast winding number: 0.014 % on an armadillo.
TEST(DirtyMesh, AtMostOneSignInSevenThousandIsWrong) {
  EXPECT_LE(wrong_signs(test::torus(1, 0.4, 160, 80), 20), 1.4e-4);
}

TEST(DirtyMesh, RealOnesToo) {
  const char* data = std::getenv("PALPATE_DATA");
  const std::filesystem::path folder = data ? data : PALPATE_SOURCE_DIR "/../shared/data";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no meshes in " << folder;
  for (const char* file : {"bench/hand_closed.obj", "organs/liver-smooth.obj"}) {
    const TriangleMesh mesh = read_surface(folder / file, 1e-3).mesh;
    const double wrong = wrong_signs(mesh, 20);
    RecordProperty(std::filesystem::path(file).stem().string(), std::to_string(wrong));
    EXPECT_LE(wrong, 1.4e-4) << file;
  }
}

// By winding number as by pseudonormal, where both are right.
TEST(DirtyMesh, OnCleanMeshesNoSignIsWrong) {
  for (const TriangleMesh& mesh : {test::torus(1, 0.4, 160, 80), test::cube(Vec3::Zero(), 1)}) {
    const Grid grid = make_grid(test::box_of(mesh), 27, 0.011);
    const LatticeSamples a = sample_lattice(SignedDistanceField(mesh, SignMethod::winding), grid);
    const LatticeSamples b = sample_lattice(SignedDistanceField(mesh, SignMethod::pseudonormal), grid);
    EXPECT_EQ(a.distance, b.distance);
  }
}

}  // namespace
}  // namespace palpate
