// How far the tissue is strained where it is touched. The gradient of the displacement along the surface is
// constant on a triangle; the rest of it, across the surface, follows from the traction there and Hooke's
// law.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "palpate/simulation/organ.hpp"

namespace palpate {

struct Loads;

// Principal strain up to which linear elasticity is trusted. Geometry: the quadratic part of the Green-
// Lagrange strain is 5 % of the linear one there. Tissue: moduli of soft tissues change visibly between 5 %
// and 20 % of compression (Krouskop et al., Ultrasonic Imaging 20, 1998).
constexpr double linear_strain = 0.1;

// Round a loaded node.
struct ContactStrain {
  float largest = 0;    // of its triangles: principal strain, linear or Green-Lagrange, absolute
  float linear = 0;     // mean |e| over its triangles, e the linear strain (Frobenius norm)
  float quadratic = 0;  // mean |H'H| / 2, what e neglects of the Green-Lagrange strain; H: gradient
};

struct Strains {
  std::vector<ContactStrain> contacts;  // one a load of the surface, in their order
  double largest = 0;                   // of them all
  bool beyond_linear() const noexcept { return largest > linear_strain; }
};

// Reads the strains off a surface. One a thread; after construction nothing is allocated.
class StrainGauge {
 public:
  explicit StrainGauge(const Organ& organ);
  // displacement: of all surface nodes, m. The cost follows the number of loads.
  void operator()(const Organ& organ, const Loads& loads, std::span<const Vec3f> displacement,
                  Strains& strains) noexcept;

 private:
  struct Frame {                    // of a triangle
    std::array<Vec3f, 3> gradient;  // of the hat of each corner along the surface, 1/m
    Vec3f normal;
    float area, lambda, mu;  // m2, Pa
  };
  struct Reading {
    std::uint64_t number = 0;  // of the call it was made in
    ContactStrain strain;
  };
  const ContactStrain& read(const Organ& organ, std::size_t triangle,
                            std::span<const Vec3f> displacement) noexcept;

  std::vector<Frame> frames_;
  std::vector<Index> begin_, triangles_;  // of each surface node
  std::vector<Reading> readings_;         // of each triangle
  std::vector<Vec3f> traction_;           // on each surface node, Pa; zero between calls
  std::uint64_t number_ = 0;
};

}  // namespace palpate
