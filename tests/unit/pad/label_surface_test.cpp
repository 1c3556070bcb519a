#include "palpate/pad/label_surface.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "palpate/geometry/check.hpp"
#include "palpate/pad/pad.hpp"

namespace palpate {
namespace {

// Voxels of 2 x 2 x 4 mm, turned and mirrored; label by place in voxels.
template <class Label>
LabelVolume volume_of(const std::array<std::size_t, 3>& size, const Label& label, bool mirrored = false) {
  LabelVolume v;
  v.size = size;
  const double angle = 0.4;
  v.to_world << 2e-3 * std::cos(angle), -2e-3 * std::sin(angle), 0, 0.1,  //
      2e-3 * std::sin(angle), 2e-3 * std::cos(angle), 0, -0.2,            //
      0, 0, mirrored ? -4e-3 : 4e-3, 0.05;
  for (std::size_t k = 0; k < size[2]; ++k)
    for (std::size_t j = 0; j < size[1]; ++j)
      for (std::size_t i = 0; i < size[0]; ++i)
        v.labels.push_back(label(Vec3(double(i), double(j), double(k))));
  return v;
}

const Vec3 middle(20, 20, 10);
std::int32_t ball(const Vec3& p) {
  const Vec3 way = (p - middle).cwiseProduct(Vec3(2, 2, 4));  // mm
  return way.norm() < 15 ? 2 : way.norm() < 30 ? 1 : 0;
}

TEST(LabelSurface, ClosedWithTheVolumeOfTheVoxels) {
  for (const bool mirrored : {false, true}) {
    const LabelVolume v = volume_of({41, 41, 21}, ball, mirrored);
    for (const std::vector<std::int32_t>& labels : {std::vector<std::int32_t>{1, 2}, {2}}) {
      const TriangleMesh mesh = label_surface(v, labels);
      const MeshReport r = check(mesh);
      EXPECT_TRUE(r.closed() && r.oriented());
      EXPECT_EQ(r.components, 1u);
      EXPECT_LT(r.area_sum.norm(), 1e-9 * r.area);
      double voxels = 0;
      for (const std::int32_t l : v.labels)
        voxels += std::find(labels.begin(), labels.end(), l) != labels.end();
      // Smoothing takes off some of a voxel squared times the curvature.
      EXPECT_NEAR(r.volume / (voxels * 16e-9), 1, labels.size() == 2 ? 0.02 : 0.06);
      const Vec3 at = v.to_world * Eigen::Vector4d(middle.x(), middle.y(), middle.z(), 1);
      for (const Vec3& p : mesh.vertices)
        EXPECT_NEAR((p - at).norm(), labels.size() == 2 ? 0.03 : 0.015, 0.0025);
    }
  }
}

TEST(LabelSurface, AtTheEdgeOfTheVolumeClosedToo) {
  const TriangleMesh mesh =
      label_surface(volume_of({5, 6, 7}, [](const Vec3&) { return 3; }), std::vector<std::int32_t>{3});
  EXPECT_TRUE(check(mesh).closed());
  EXPECT_NEAR(volume(mesh) / (5 * 6 * 7 * 16e-9), 1, 0.15);  // rounded corners
}

TEST(LabelSurface, SaysWhatIsMissing) {
  const LabelVolume v = volume_of({9, 9, 9}, [](const Vec3& p) { return p == Vec3(4, 4, 4) ? 7 : 0; });
  EXPECT_THROW(label_surface(v, std::vector<std::int32_t>{1, 5}), Error);
  EXPECT_THROW(label_surface(v, std::vector<std::int32_t>{7}), Error);  // one voxel
}

TEST(LabelSurface, PaddedWithRegions) {
  const LabelVolume v = volume_of({41, 41, 21}, ball);
  PadOptions o;
  o.surface_nodes = 1500;
  const Padded padded = pad(label_surface(v, std::vector<std::int32_t>{1, 2}),
                            {{"core", label_surface(v, std::vector<std::int32_t>{2})}}, o);
  double core = 0;
  for (std::size_t i = 0; i < padded.mesh.tets.size(); ++i)
    core += padded.mesh.regions[i] == 1 ? six_volume(padded.mesh, padded.mesh.tets[i]) / 6 : 0;
  EXPECT_NEAR(core / (4.0 / 3 * M_PI * std::pow(0.015, 3)), 1, 0.05);
  EXPECT_GE(padded.report.quality.min_dihedral, 10.7);
}

}  // namespace
}  // namespace palpate
