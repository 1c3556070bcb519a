// Isotropic linear elasticity, one material a region.
#pragma once

#include <string>
#include <vector>

#include "palpate/base/vec.hpp"

namespace palpate {

struct Material {
  double young = 0;       // E, Pa
  double poisson = 0;     // nu, -1 < nu < 0.5
  double density = 1000;  // kg/m3

  double lambda() const {
    return young * poisson / ((1 + poisson) * (1 - 2 * poisson));
  }                                                          // Lame's first parameter, Pa
  double mu() const { return young / (2 * (1 + poisson)); }  // shear modulus, Pa
};

// Error(physics) unless young > 0, -1 < poisson < 0.5, all finite. `where` names the region.
void require_valid(const Material& material, const std::string& where);

}  // namespace palpate
