// What the contact forces do to the whole surface. A tick of forces does not wait for it: deform() is a
// thread's own work where there are threads, and each of them has a Deformer.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "palpate/contact/clusters.hpp"
#include "palpate/simulation/strain.hpp"

namespace palpate {

// Forces on the organ in its own frame, a row of the compliance at most once. Capacity is the vectors' size.
struct Loads {
  std::size_t count = 0;
  std::vector<Index> rows;   // of the compliance
  std::vector<Vec3> forces;  // N
  std::vector<Vec3> u;       // what they do where they act, in float64, m; right if
  bool u_known = true;
  std::uint64_t number = 0;  // no two different sets of a simulation have the same; 0: none yet

  Loads() = default;
  explicit Loads(std::size_t capacity) : rows(capacity, -1), forces(capacity), u(capacity) {}
  double work() const noexcept;  // of the forces on u, J
  // Takes over another's, of the same capacity.
  void copy(const Loads& other) noexcept;
};

// The surface under some loads, organ frame.
struct Surface {
  Loads loads;
  std::vector<Vec3f> displacement;  // of the surface nodes from rest, m: what is drawn
  std::vector<Vec3f> reading;       // of its contact points, m; of linear tetrahedra the same
  std::vector<Vec3> positions;      // of the contact points, m
  Strains strains;                  // where the loads act
  ClusterBounds bounds;             // of the free ones, in `clusters`
  std::shared_ptr<const Clusters> clusters;
};

// At rest. Its clusters' softness bounds how far a node moves: by at most softness sqrt(f.C f) under forces
// f.
Surface make_surface(const Organ& organ);

// u = C f on the whole surface. One a thread; after construction nothing is allocated.
class Deformer {
 public:
  explicit Deformer(const Organ& organ);
  void operator()(const Organ& organ, const Loads& loads, Surface& surface) noexcept;

 private:
  Compliance compliance_;  // the organ's, with work space
  StrainGauge gauge_;
  std::vector<float> forces_, u_;
  std::vector<Eigen::Vector4f> means_, drawn_, work_;  // for the projection onto the surface nodes
};

}  // namespace palpate
