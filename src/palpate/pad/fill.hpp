// Interior points of a body: nested body-centred grids, coarser with depth.
#pragma once

#include <span>
#include <vector>

#include "palpate/base/progress.hpp"
#include "palpate/geometry/bvh.hpp"
#include "palpate/geometry/signed_distance.hpp"

namespace palpate {

// A surface inside the body that points keep away from, and the distance between points near it.
struct Spaced {
  Bvh surface;
  double spacing;  // m
};

// Points inside `outer`, at least a good half of a spacing away from it and from the `inner` surfaces. Near a
// surface neighbours are about its spacing apart; with `grade` the distance grows with the way from the
// nearest surface. Throws Error(resource) beyond `limit` points.
std::vector<Vec3> fill(const Box& box, const SignedDistanceField& outer, double spacing,
                       std::span<const Spaced> inner, bool grade, std::size_t limit,
                       const Progress& progress = {});

}  // namespace palpate
