// Elasticity one order above that of the elements, to see how far off they are: to linear tetrahedra a
// quadratic function of each edge is added, to quadratic ones a cubic function of each edge and of each
// face. Zienkiewicz, Taylor, The Finite Element Method vol. 1 (2000), ch. 8.9 (hierarchical shape functions);
// Bank, Smith, "A posteriori error estimates based on hierarchical bases" (1993).
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "palpate/elasticity/element_nodes.hpp"
#include "palpate/elasticity/material.hpp"

namespace palpate {

// Built once, then const and thread-safe. u: displacements of the free nodes, 3 a node, m; w: coefficients of
// the added functions, 3 a function, m; forces in N.
class Enrichment {
 public:
  // free_of: number of each node among the free ones, -1: anchored. Functions are added within `tets`, where
  // they are 0 on everything else and where not all of their corners are anchored.
  Enrichment(const TetMesh& mesh, const ElementNodes& nodes, const std::vector<Material>& materials,
             std::span<const Index> free_of, const std::vector<Index>& tets);

  std::size_t size() const { return functions_.size(); }
  // Nodes that a function is of: two of an edge and -1, or three of a face; ascending.
  const std::array<Index, 3>& corners(std::size_t function) const { return functions_[function]; }
  // What the added functions bring about: on the nodes K_uw w is added to `force`; on themselves `added`
  // becomes K_wu u + K_ww w.
  void multiply(const Eigen::VectorXd& u, const Eigen::VectorXd& w, Eigen::VectorXd& force,
                Eigen::VectorXd& added) const;
  // By the inverse of K_ww's 3 x 3 blocks on the diagonal.
  Eigen::VectorXd precondition(const Eigen::VectorXd& added) const;
  // Work of a traction (N/m2 at the corners, linear between) on a triangle of the boundary (nodes, m2), per
  // unit of each function: added to `force` and `added`.
  void add_traction(const ElementNodes& nodes, std::span<const Index> free_of, const Triangle& triangle,
                    double area, const std::array<Vec3, 3>& traction, Eigen::VectorXd& force,
                    Eigen::VectorXd& added) const;

 private:
  using Function = std::array<Index, 3>;                    // corners ascending; edges: the third is -1
  using Slopes = Eigen::Matrix<double, 4, Eigen::Dynamic>;  // by the barycentric coordinates, a function each
  struct Element {
    Eigen::Matrix<double, 4, 3> g;  // gradients of the barycentric coordinates, 1/m
    double lambda_v, mu_v;          // Lame's parameters times the volume, J
    std::array<Index, 10> node;     // free nodes, -1: anchored or none
    std::array<Index, 10> added;    // functions, -1: none
    std::array<double, 10> sign;    // of each
  };
  Index find(const Function& f) const;

  int order_;
  std::vector<Function> functions_;  // ascending
  std::vector<Element> elements_;
  std::vector<double> weight_;      // of the points of quadrature, sum 1
  std::vector<Slopes> own_, more_;  // of the nodes' functions and of those added, at each point
  std::vector<Mat3> inverse_;       // of the diagonal blocks
};

}  // namespace palpate
