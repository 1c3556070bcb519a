// Generalised winding number: 1 inside, 0 outside, in between near holes. The modern form of the thesis'
// solid angle (T eq. 5.1). Jacobson, Kavan, Sorkine, "Robust inside-outside segmentation using generalized
// winding numbers" (2013); Barill, Dickson, Schmidt, Levin, Jacobson, "Fast winding numbers for soups and
// clouds" (2018): second-order expansion on a tree; van Oosterom, Strackee, "The solid angle of a plane
// triangle" (1983).
#pragma once

#include <array>
#include <vector>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

// Exact sum over all triangles. Slow; the oracle of the fast one.
double winding_number(const TriangleMesh& mesh, const Vec3& p);

// Built once, then const and thread-safe.
class WindingNumber {
 public:
  // accuracy: a box counts as far from a point when the distance exceeds accuracy times its radius (Barill et
  // al.: 2).
  explicit WindingNumber(const TriangleMesh& mesh, double accuracy = 2.0);
  double at(const Vec3& p) const;

 private:
  struct Node {
    Vec3 center = Vec3::Zero();  // area-weighted centre
    double radius = 0;           // of the ball about the centre that holds its triangles
    // The expansion about the centre, see the .cpp: y from the centre, n the unit normal, integrals over the
    // triangles.
    Vec3 first = Vec3::Zero();       // int n
    Mat3 second = Mat3::Zero();      // int y n^T, symmetric part
    Vec3 third = Vec3::Zero();       // int (n.y) 2 y + (y.y) n
    std::array<double, 10> cubic{};  // int n_i y_j y_k, symmetric part, as the polynomial's coefficients
    std::size_t begin = 0, end = 0;  // its triangles, in tree order
    std::size_t child = 0;           // first of two children; 0: leaf
  };
  void expand(Node& node) const;
  static double far_field(const Node& node, const Vec3& r);
  std::vector<Node> nodes_;
  std::vector<std::array<Vec3, 3>> corners_;
  double accuracy_;
};

}  // namespace palpate
