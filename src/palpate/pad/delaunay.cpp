// The convex hull of the points lifted to a paraboloid. Barber, Dobkin, Huhdanpaa, "The Quickhull algorithm
// for convex hulls" (1996).
#include "palpate/pad/delaunay.hpp"

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>

#include "palpate/base/error.hpp"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wconversion"
extern "C" {
#include <libqhull_r/qhull_ra.h>
}
#pragma GCC diagnostic pop

namespace palpate {

namespace {

// Qhull's state and the text of its complaints; freed whatever happens.
class Qhull {
 public:
  Qhull() : log_(open_memstream(&text_, &length_)) {
    if (!log_) throw Error(ErrorKind::resource, "no memory for Qhull");
    qh_zero(&qh, log_);
  }
  ~Qhull() {
    qh_freeqhull(&qh, !qh_ALL);
    int count = 0, bytes = 0;
    qh_memfreeshort(&qh, &count, &bytes);
    std::fclose(log_);
    std::free(text_);
  }
  Qhull(const Qhull&) = delete;
  Qhull& operator=(const Qhull&) = delete;

  void run(std::vector<double>& coordinates) {
    // QJ: simplicial whatever rounding does; Qbb: the lifted coordinate scaled to the others; Pp: no remarks.
    std::string options = "qhull d QJ Qbb Pp";
    const int code = qh_new_qhull(&qh, 3, static_cast<int>(coordinates.size() / 3), coordinates.data(), False,
                                  options.data(), nullptr, log_);
    if (code == 0) return;
    if (code == qh_ERRmem) throw Error(ErrorKind::resource, "Qhull ran out of memory; use a larger spacing");
    std::fflush(log_);
    const std::string all(text_, length_), first = all.substr(0, all.find('\n'));
    throw Error(ErrorKind::geometry, "Qhull found no Delaunay tetrahedra: {}", first);
  }

  qhT qh;

 private:
  char* text_ = nullptr;
  std::size_t length_ = 0;
  std::FILE* log_;
};

std::uint64_t mix(std::uint64_t x) {  // splitmix64
  x += 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

}  // namespace

void joggle(std::span<Vec3> points, double amount) {
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const double unit = static_cast<double>(mix(3 * i + k) >> 11) * 0x1p-53;  // in [0, 1)
      points[i][static_cast<Eigen::Index>(k)] += amount * (2 * unit - 1);
    }
}

std::vector<Tetrahedron> delaunay(std::span<Vec3> points) {
  if (points.size() < 5) throw Error(ErrorKind::geometry, "{} points span no volume", points.size());
  const Box box = bounding_box(points);
  const double scale = 1 / box.diagonal();
  std::vector<double> coordinates;
  coordinates.reserve(3 * points.size());
  for (const Vec3& p : points)
    for (int k = 0; k < 3; ++k) coordinates.push_back((p[k] - box.center()[k]) * scale);

  const auto qhull = std::make_unique<Qhull>();
  qhull->run(coordinates);
  qhT* const qh = &qhull->qh;
  std::vector<Tetrahedron> tets;
  facetT* facet;
  FORALLfacets {
    if (facet->upperdelaunay) continue;
    Tetrahedron t{};
    std::size_t n = 0;
    vertexT *vertex, **vertexp;
    FOREACHvertex_(facet->vertices) {
      if (n < 4) t[n] = static_cast<Index>(qh_pointid(qh, vertex->point));
      ++n;
    }
    if (n != 4) throw Error(ErrorKind::internal, "Qhull gave a facet of {} corners", n);
    if (facet->toporient ^ qh_ORIENTclock) std::swap(t[0], t[1]);
    tets.push_back(t);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    const coordT* const moved = qh->first_point + 4 * i;  // lifted: four a point
    points[i] = box.center() + Vec3(moved[0], moved[1], moved[2]) / scale;
  }
  // Which of Qhull's two senses of orientation is ours depends on the lifting: asked of the volume's sign.
  double sum = 0;
  const auto at = [&](Index i) -> const Vec3& { return points[static_cast<std::size_t>(i)]; };
  for (const auto& [a, b, c, d] : tets) sum += (at(b) - at(a)).cross(at(c) - at(a)).dot(at(d) - at(a));
  if (sum < 0)
    for (Tetrahedron& t : tets) std::swap(t[0], t[1]);
  return tets;
}

}  // namespace palpate
