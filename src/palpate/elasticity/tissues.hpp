// Tissues by name: typical values for small strains, their ranges, and where they were measured.
#pragma once

#include <span>
#include <string>

#include "palpate/elasticity/material.hpp"

namespace palpate {

struct Tissue {
  const char* name;
  Material typical;
  double young_low, young_high;  // Pa, what the source reports (mean -+ standard deviation, or its extremes)
  const char* source;
};

// Poisson's ratio of soft tissue is 0.49 throughout: nearly incompressible, as water is. Densities: ICRU
// Report 44 (1989); of the stone an estimate.
std::span<const Tissue> tissues();

// "liver", or "E,nu" or "E,nu,density" (Pa, -, kg/m3). Throws Error(usage) with the names there are, or
// Error(physics) for values that are no material; `where` names the option or key.
Material parse_material(const std::string& text, const std::string& where);

}  // namespace palpate
