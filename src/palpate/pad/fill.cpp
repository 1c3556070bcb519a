// An octree refined towards the surfaces; each leaf gives its centre and its lowest corner, which together
// are a body-centred grid wherever leaves are of one size, and coarse grids are part of fine ones. Labelle,
// Shewchuk, "Isosurface stuffing" (2007), for the grid; its tetrahedra are nearly regular.
#include "palpate/pad/fill.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {

// Neighbours of a body-centred grid are sqrt(3)/2 of its cube's side apart.
const double side_of_spacing = 2 / std::sqrt(3.0);
constexpr double growth = 2;        // of the side with depth
constexpr double clearance = 0.57;  // of the spacing, from any surface: best elements by experiment

class Filler {
 public:
  Filler(const SignedDistanceField& outer, double spacing, std::span<const Spaced> inner, bool grade,
         std::size_t limit, const Progress& progress)
      : outer_(outer), spacing_(spacing), inner_(inner), grade_(grade), limit_(limit), progress_(progress) {}

  std::vector<Vec3> run(const Box& box) {
    finest_ = spacing_;
    for (const Spaced& s : inner_) finest_ = std::min(finest_, s.spacing);
    finest_ *= side_of_spacing;
    const double size = box.size().maxCoeff();
    if (!(size / finest_ < 1e5))
      throw Error(ErrorKind::resource,
                  "interior points {:.3g} m apart in a body of {:.3g} m: use a larger spacing", finest_,
                  size);
    int level = 0;
    while (std::ldexp(finest_, level) < size) ++level;
    // Off the body's symmetry planes, on which box-like surfaces would get points on common spheres.
    const Vec3 origin = box.min - finest_ * Vec3(0.31, 0.43, 0.37);
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3 step(corner & 1, (corner >> 1) & 1, corner >> 2);
      cell(origin + std::ldexp(finest_, level) * step, level);
    }
    return std::move(points_);
  }

 private:
  struct Place {
    double signed_distance;  // to the outer surface, m
    double room;             // least distance to any surface by its clearance, 1: just far enough
    double side;             // of the cubes wanted here, m
  };

  Place look(const Vec3& p) {
    const SignedDistance d = outer_.at(p, std::numeric_limits<double>::infinity(), hint_);
    hint_ = d.triangle;
    Place place{d.distance, -d.distance / (clearance * spacing_),
                side_of_spacing * spacing_ + growth * std::max(0.0, -d.distance - 0.7 * spacing_)};
    for (const Spaced& s : inner_) {
      const double distance = std::sqrt(s.surface.closest(p).distance_squared);
      place.room = std::min(place.room, distance / (clearance * s.spacing));
      place.side = std::min(place.side,
                            side_of_spacing * s.spacing + growth * std::max(0.0, distance - 0.7 * s.spacing));
    }
    if (!grade_) place.side = finest_;
    return place;
  }

  void cell(const Vec3& corner, int level) {
    if ((++visited_ & 1023) == 0) progress_.at(0);
    const double side = std::ldexp(finest_, level);
    const Vec3 center = corner + Vec3::Constant(side / 2);
    const Place place = look(center);
    if (place.signed_distance > std::sqrt(0.75) * side) return;
    if (level > 0 && place.side < side) {
      for (int child = 0; child < 8; ++child) {
        const Vec3 step(child & 1, (child >> 1) & 1, child >> 2);
        cell(corner + side / 2 * step, level - 1);
      }
      return;
    }
    if (place.room >= 1) push(center);
    if (look(corner).room >= 1) push(corner);
  }

  void push(const Vec3& p) {
    if (points_.size() >= limit_)
      throw Error(ErrorKind::resource, "more than {} interior points {:.3g} m apart: use a larger spacing",
                  limit_, finest_ / side_of_spacing);
    points_.push_back(p);
  }

  const SignedDistanceField& outer_;
  double spacing_, finest_ = 0;
  std::span<const Spaced> inner_;
  bool grade_;
  std::size_t limit_, visited_ = 0;
  const Progress& progress_;
  Index hint_ = -1;
  std::vector<Vec3> points_;
};

}  // namespace

std::vector<Vec3> fill(const Box& box, const SignedDistanceField& outer, double spacing,
                       std::span<const Spaced> inner, bool grade, std::size_t limit,
                       const Progress& progress) {
  return Filler(outer, spacing, inner, grade, limit, progress).run(box);
}

}  // namespace palpate
