// Where instruments finer than the surface's triangles touch between its nodes: contact points placed on
// edges and faces on demand, which ride on the three nodes of a triangle.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "palpate/contact/clusters.hpp"
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

// What is thicker than this share of a triangle's longest edge meets its nodes.
constexpr double fine_enough = 0.4;

// How thick an instrument is by its box, m: a needle is thin in two directions.
double middle_side(const Box& box);
// Of the triangles between contact points, at rest, m.
double longest_edge(const Organ& organ);

// A triangle between contact points, at rest.
struct Face {
  Vec3 normal = Vec3::Zero();                  // outwards, unit
  Vec3 squares = Vec3::Zero();                 // of the edges opposite to the corners, m2
  double longest = 0;                          // edge, m
  Vec3 fixed = Vec3::Zero();                   // 1: the corner cannot move
  std::array<Index, 3> beside = {-1, -1, -1};  // the triangle across the edge opposite to each corner
};

// What is baked of an organ's faces for its instruments; empty where no instrument is fine enough to need
// places.
struct Faces {
  std::vector<Face> faces;  // of each triangle of the organ's surface
  // Of each cluster of nodes that can move: triangles, each of them the cluster's that its first such node is
  // in; the nodes of these, each once; the clusters of these nodes; and how far the nodes move at most
  // (Clusters::softness). holds_anchored: some of the nodes cannot move, and are in no cluster.
  std::vector<Index> triangles_begin, triangles, corners_begin, corners, beside_begin, beside;
  std::vector<float> softness;
  std::vector<std::uint8_t> holds_anchored;
  std::vector<double> thickness;  // of each instrument, half, m; 0: so blunt that it never needs a place

  Faces() = default;
  Faces(const Organ& organ, std::span<const Instrument> instruments, const Clusters& clusters);
  bool empty() const noexcept { return faces.empty(); }
  bool needs_places(std::size_t triangle, std::size_t instrument) const noexcept {
    return thickness[instrument] < fine_enough * faces[triangle].longest;
  }
  // How much deeper in the organ than on the triangle an instrument's place lies, m. The height of a ball's
  // cap over a chord: sum of w_i w_j |x_i - x_j|^2 over twice the radius (that the corners touch), which is
  // zero at the corners and on the triangle continuous.
  double allowance(std::size_t triangle, std::size_t instrument, const Vec3& weights) const noexcept {
    return 0.5 * weights.dot(allowance_gradient(triangle, instrument, weights));
  }
  Vec3 allowance_gradient(std::size_t triangle, std::size_t instrument, const Vec3& weights) const noexcept {
    const Face& f = faces[triangle];
    const Vec3 &s = f.squares, &w = weights;
    return 3 * most_allowance(triangle, instrument) / (f.longest * f.longest) *
           Vec3(w[1] * s[2] + w[2] * s[1], w[2] * s[0] + w[0] * s[2], w[0] * s[1] + w[1] * s[0]);
  }
  double most_allowance(std::size_t triangle, std::size_t instrument) const noexcept {
    return felt_from * std::min(faces[triangle].longest, thickness[instrument]);
  }
};

// What a tick has seen of a triangle and an instrument.
struct LookedAt {
  std::array<Vec3, 3> corners = {Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};  // where they were
  double clearance = 0;         // m: while none has moved farther from there, nothing is to be found
  Vec3 weights = Vec3::Zero();  // of the deepest point; 0: the instrument is not near
  std::uint64_t tick = 0;
};

}  // namespace palpate
