// Where instruments finer than the surface's triangles touch between its nodes: contact points placed on
// edges and faces on demand, which ride on the three nodes of a triangle.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "palpate/simulation/organ.hpp"

namespace palpate {

struct ContactPoint;
struct Instrument;

// Of a tick, at most; each counts as three contacts (Settings::max_contacts).
constexpr std::size_t most_places = 128;

// How deep an instrument may reach into a triangle between nodes before it is felt there, as a share of the
// triangle's longest edge or half the instrument's thickness, whichever is less. The middle of a triangle in
// contact at its nodes lies so deep in a round instrument; what that does is the nodes' business.
constexpr double felt_from = 0.1;

// A triangle between contact points, at rest.
struct Face {
  Vec3 normal = Vec3::Zero();   // outwards, unit
  Vec3 squares = Vec3::Zero();  // of the edges opposite to the corners, m2
  double longest = 0;           // edge, m
};

// What is baked of an organ's faces for its instruments; empty where no instrument is fine enough to need
// places.
struct Faces {
  std::vector<Face> faces;                 // of each triangle of the organ's surface
  std::vector<Index> begin, triangles_of;  // of each surface node
  std::vector<float> reach;  // of each surface node, m: a point of its triangles nearest to it is no farther
  double most_reach = 0;     // m
  std::vector<double> thickness;  // of each instrument, half, m; 0: so blunt that it never needs a place

  Faces() = default;
  Faces(const Organ& organ, std::span<const Instrument> instruments);
  bool empty() const noexcept { return faces.empty(); }
  // How much deeper in the organ than on the triangle an instrument's place lies, m. The height of a ball's
  // cap over a chord: sum of w_i w_j |x_i - x_j|^2 over twice the radius (that the corners touch), which is
  // zero at the corners and on the triangle continuous.
  double allowance(std::size_t triangle, std::size_t instrument, const Vec3& weights) const noexcept {
    return 0.5 * weights.dot(allowance_gradient(triangle, instrument, weights));
  }
  Vec3 allowance_gradient(std::size_t triangle, std::size_t instrument, const Vec3& weights) const noexcept {
    const Face& f = faces[triangle];
    const Vec3 &s = f.squares, &w = weights;
    return 3 * felt_from * std::min(f.longest, thickness[instrument]) / (f.longest * f.longest) *
           Vec3(w[1] * s[2] + w[2] * s[1], w[2] * s[0] + w[0] * s[2], w[0] * s[1] + w[1] * s[0]);
  }
};

}  // namespace palpate
