#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/global_control.h>

#include "peers.hpp"

namespace palpate::peers {

namespace {

class OpenVdb final : public GridSampler {
 public:
  OpenVdb(const Vec3& origin, double h, const std::array<std::int32_t, 3>& n, std::span<const float> values)
      : origin_(origin), inverse_h_(1 / h) {
    openvdb::initialize();
    const openvdb::CoordBBox box(0, 0, 0, n[0] - 1, n[1] - 1, n[2] - 1);
    const openvdb::tools::Dense<const float, openvdb::tools::LayoutZYX> dense(box, values.data());
    grid_ = openvdb::FloatGrid::create(0.0f);
    openvdb::tools::copyFromDense(dense, *grid_, 0.0f);
  }
  void sample(std::span<const Vec3> points, std::span<double> out) const override {
    const openvdb::FloatGrid::ConstAccessor accessor = grid_->getConstAccessor();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3 p = (points[i] - origin_) * inverse_h_;
      out[i] = static_cast<double>(
          openvdb::tools::BoxSampler::sample(accessor, openvdb::Vec3R(p.x(), p.y(), p.z())));
    }
  }

 private:
  Vec3 origin_;
  double inverse_h_;
  openvdb::FloatGrid::Ptr grid_;
};

class OpenVdbBand final : public BandFill {
 public:
  OpenVdbBand(const TriangleMesh& mesh, double h, float width) : h_(h), width_(width) {
    openvdb::initialize();
    for (const Vec3& p : mesh.vertices)
      points_.emplace_back(static_cast<float>(p.x() / h), static_cast<float>(p.y() / h),
                           static_cast<float>(p.z() / h));
    for (const Triangle& t : mesh.triangles)
      triangles_.emplace_back(static_cast<std::uint32_t>(t[0]), static_cast<std::uint32_t>(t[1]),
                              static_cast<std::uint32_t>(t[2]));
  }
  std::size_t fill() override {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I> mesh(points_,
                                                                                          triangles_);
    const auto grid = openvdb::tools::meshToVolume<openvdb::FloatGrid>(
        mesh, *openvdb::math::Transform::createLinearTransform(h_), width_, width_);
    return grid->activeVoxelCount();
  }

 private:
  double h_;
  float width_;
  std::vector<openvdb::Vec3s> points_;  // in units of h
  std::vector<openvdb::Vec3I> triangles_;
};

}  // namespace

std::unique_ptr<BandFill> make_openvdb_band(const TriangleMesh& mesh, double h, float width) {
  return std::make_unique<OpenVdbBand>(mesh, h, width);
}

std::unique_ptr<GridSampler> make_openvdb(const Vec3& origin, double h, const std::array<std::int32_t, 3>& n,
                                          std::span<const float> values) {
  return std::make_unique<OpenVdb>(origin, h, n, values);
}

}  // namespace palpate::peers
