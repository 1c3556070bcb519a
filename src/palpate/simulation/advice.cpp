// How thin a solid is by its shape diameter (Shapira, Shamir, Cohen-Or, "Consistent mesh partitioning and
// skeletonisation using the shape diameter function", 2008), of one ray a point: the way through it from its
// surface along the inward normal.
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "palpate/simulation/places.hpp"
#include "palpate/simulation/scene.hpp"

namespace palpate {

namespace {

// From a point of the surface through the solid, m; `most` where it is no less, or where the solid is not
// known `least` below its surface: a lattice rounds off what is finer than its cells.
double way_through(const Shape& shape, const Vec3& from, const Vec3& inwards, double least, double most) {
  for (double way = least; way < most;) {
    const double d = distance(shape, from + way * inwards);
    if (d >= 0) return way == least ? most : way;
    way += std::max(-d, least);
  }
  return most;
}

}  // namespace

double thinnest_part(const Instrument& instrument, double most) {
  const TriangleMesh& mesh = instrument.surface;
  // Each triangle in its middle and near its corners, where a tip is.
  constexpr double near = 0.9, far = 0.5 * (1 - near);
  const double least = std::min(finest(instrument.shape), 0.02 * most);
  for (const Triangle& t : mesh.triangles) {
    const Vec3 area = area_vector(mesh, t);
    if (!(area.norm() > 0)) continue;
    std::array<Vec3, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) corners[k] = mesh.vertices[static_cast<std::size_t>(t[k])];
    const Vec3 sum = corners[0] + corners[1] + corners[2];
    for (std::size_t k = 0; k < 4; ++k)
      most = std::min(most, way_through(instrument.shape,
                                        k == 3 ? Vec3(sum / 3) : Vec3(far * sum + (near - far) * corners[k]),
                                        -area.normalized(), least, most));
  }
  return most;
}

std::vector<std::string> advice(const Scene& scene) {
  std::vector<std::string> out;
  if (scene.models[0].settings.mode != Mode::unilateral) return out;
  double edge = 0;
  for (const Model& model : scene.models) edge = std::max(edge, longest_edge(model.organ));
  const double fine = 2 * fine_enough * edge;
  for (const Instrument& instrument : scene.models[0].instruments) {
    if (instrument.tip > 0 || instrument.surface.triangles.empty() ||
        middle_side(bounding_box(instrument.surface.vertices)) < fine)
      continue;
    const double thin = thinnest_part(instrument, fine);
    const double said = 0.95 * thin;  // whichever way it is rounded, it is fine
    if (thin < fine)
      out.push_back(fmt::format(
          "instrument '{}' is thin in places ({:.2g} mm) beside the organ's triangles (edges of up to {:.2g} "
          "mm) and felt at their nodes only; tip = \"{:.2g} mm\" makes it felt between them, too "
          "(docs/contact.md)",
          instrument.name, 1e3 * thin, 1e3 * edge, 1e3 * said));
  }
  return out;
}

}  // namespace palpate
