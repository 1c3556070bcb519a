#include <embree3/rtcore.h>

#include <cmath>

#include "peers.hpp"

namespace palpate::peers {

namespace {

struct Best {
  const std::vector<std::array<Vec3f, 3>>* corners;
  Vec3f point;
};

// Ericson, Real-Time Collision Detection (2005), 5.1.5.
Vec3f closest_on_triangle(const Vec3f& p, const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const Vec3f ab = b - a, ac = c - a, ap = p - a;
  const float d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vec3f bp = p - b;
  const float d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const Vec3f cp = p - c;
  const float d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const float scale = 1.0f / (va + vb + vc);
  return a + vb * scale * ab + vc * scale * ac;
}

bool visit(RTCPointQueryFunctionArguments* arguments) {
  auto& best = *static_cast<Best*>(arguments->userPtr);
  const auto& [a, b, c] = (*best.corners)[arguments->primID];
  const Vec3f p(arguments->query->x, arguments->query->y, arguments->query->z);
  const Vec3f q = closest_on_triangle(p, a, b, c);
  const float distance = (q - p).norm();
  if (distance >= arguments->query->radius) return false;
  arguments->query->radius = distance;
  best.point = q;
  return true;
}

class Embree final : public ClosestPoints {
 public:
  explicit Embree(const TriangleMesh& mesh)
      : device_(rtcNewDevice("threads=1")), scene_(rtcNewScene(device_)) {
    for (const Triangle& t : mesh.triangles)
      corners_.push_back({mesh.vertices[t[0]].cast<float>(), mesh.vertices[t[1]].cast<float>(),
                          mesh.vertices[t[2]].cast<float>()});
    const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), mesh.vertices.size()));
    for (const Vec3& v : mesh.vertices)
      for (int a = 0; a < 3; ++a) *vertices++ = static_cast<float>(v[a]);
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), mesh.triangles.size()));
    for (const Triangle& t : mesh.triangles)
      for (const Index i : t) *indices++ = static_cast<unsigned>(i);
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
  }
  ~Embree() override {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  Embree(const Embree&) = delete;
  Embree& operator=(const Embree&) = delete;

  void query(std::span<const Vec3> points, std::span<Vec3> closest,
             std::span<double> distance) const override {
    for (std::size_t i = 0; i < points.size(); ++i) {
      RTCPointQuery query;
      query.x = static_cast<float>(points[i].x());
      query.y = static_cast<float>(points[i].y());
      query.z = static_cast<float>(points[i].z());
      query.time = 0;
      query.radius = std::numeric_limits<float>::infinity();
      RTCPointQueryContext context;
      rtcInitPointQueryContext(&context);
      Best best{&corners_, Vec3f::Zero()};
      rtcPointQuery(scene_, &query, &context, visit, &best);
      closest[i] = best.point.cast<double>();
      distance[i] = query.radius;
    }
  }

 private:
  RTCDevice device_;
  RTCScene scene_;
  std::vector<std::array<Vec3f, 3>> corners_;
};

}  // namespace

std::unique_ptr<ClosestPoints> make_embree(const TriangleMesh& mesh) {
  return std::make_unique<Embree>(mesh);
}

}  // namespace palpate::peers
