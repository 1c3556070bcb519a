#include "palpate/io/surface_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include "palpate/base/error.hpp"
#include "palpate/io/atomic_file.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

const fs::path models = "/usr/share/inventor/data/models";

TEST(Inventor, ReadsTorusAndBishop) {
  if (!fs::exists(models)) GTEST_SKIP() << "Debian's inventor-data is not installed";
  const SurfaceFile torus = read_surface(models / "torus.iv");
  EXPECT_EQ(torus.format, "Open Inventor");
  EXPECT_EQ(torus.mesh.vertices.size(), 576u);
  EXPECT_EQ(torus.mesh.triangles.size(), 1152u);
  EXPECT_NEAR(volume(torus.mesh), 4.59318e-4, 1e-9);
  const SurfaceFile bishop = read_surface(models / "chess/bishop.iv", 10);
  EXPECT_EQ(bishop.mesh.vertices.size(), 250u);
  EXPECT_EQ(bishop.mesh.triangles.size(), 496u);
  EXPECT_NEAR(volume(bishop.mesh), 2.4617e-2, 1e-6);
}

}  // namespace
}  // namespace palpate
