// What the contact forces do to the whole surface. A tick of forces does not wait for it: deform() is a
// thread's own work where there are threads, and each of them has a Deformer.
#pragma once

#include <array>
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
  explicit Loads(std::size_t capacity)
      : rows(capacity, -1), forces(capacity, Vec3::Zero()), u(capacity, Vec3::Zero()) {}
  double work() const noexcept;  // of the forces on u, J
  // And where the surface nodes move so far, m.
  template <class Vector>
  double work_on(std::span<const Index> node_of_row, const std::vector<Vector>& moved) const noexcept {
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i)
      sum += forces[i].dot(moved[static_cast<std::size_t>(node_of_row[static_cast<std::size_t>(rows[i])])]
                               .template cast<double>());
    return sum;
  }
  // Takes over another's, of the same capacity.
  void copy(const Loads& other) noexcept;
};

// What a change of the loads did to the contact points of the surface.
struct Change {
  std::vector<Vec3> moved;  // m
  ClusterBounds bounds;     // of these
  double work = 0;          // of the change on them, J; 0: not known, or nothing
  double of_loads = 0;      // of the surface's loads on them, J
};

// The surface under some loads, organ frame.
struct Surface {
  Loads loads;
  std::vector<Vec3f> displacement;  // of the surface nodes from rest, m: what is drawn
  std::vector<Vec3f> reading;       // of its contact points, m; of linear tetrahedra the same
  std::vector<Vec3> positions;      // of the contact points, m
  Strains strains;                  // where the loads act
  ClusterBounds bounds;             // of the free ones, in `clusters`
  // What has changed of the loads since the surface that its Deformer made before, and by then since the one
  // before that: the change of more work, and what the other is besides, so that neither does work on the
  // other. They tell where the points are going; the last alone does not where a motion has just turned back.
  std::array<Change, 2> changes;
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
  void find_changes(const Organ& organ, const Loads& loads, Surface& surface) noexcept;

  Compliance compliance_;  // the organ's, with work space
  StrainGauge gauge_;
  std::vector<float> forces_, u_;
  Loads last_;  // the surface's before
  std::vector<float> last_u_;
  std::vector<Vec3> last_moved_;  // by its change
  double last_work_ = 0;
  std::vector<Eigen::Vector4f> means_, drawn_, work_;  // for the projection onto the surface nodes
};

}  // namespace palpate
