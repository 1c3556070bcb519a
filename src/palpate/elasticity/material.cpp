#include "palpate/elasticity/material.hpp"

#include <cmath>

#include "palpate/base/error.hpp"

namespace palpate {

void require_valid(const Material& material, const std::string& where) {
  const auto [young, poisson, density] = material;
  if (!(young > 0) || !std::isfinite(young))
    throw Error(ErrorKind::physics,
                "{}: Young's modulus is {} Pa; it must be positive (soft tissue: 1e3 to 1e5)", where, young);
  if (poisson >= 0.5)
    throw Error(ErrorKind::physics,
                "{}: Poisson's ratio is {}; at 0.5 and above volume cannot change and displacements have no "
                "stiffness matrix: use 0.45 to 0.49 for tissue",
                where, poisson);
  if (!(poisson > -1))
    throw Error(ErrorKind::physics,
                "{}: Poisson's ratio is {}; it must lie between -1 and 0.5 (tissue: 0.45)", where, poisson);
  if (!(density > 0) || !std::isfinite(density))
    throw Error(ErrorKind::physics, "{}: density is {} kg/m3; it must be positive (water: 1000)", where,
                density);
  if (!std::isfinite(material.lambda()) || !(material.mu() > 0))
    throw Error(ErrorKind::physics, "{}: E = {} Pa and nu = {} give no finite stiffness", where, young,
                poisson);
}

}  // namespace palpate
