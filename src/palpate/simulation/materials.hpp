// Materials of a mesh: those given for its regions, and those in its file.
#pragma once

#include <string>
#include <vector>

#include "palpate/elasticity/material.hpp"
#include "palpate/io/tet_file.hpp"

namespace palpate {

struct RegionMaterial {
  std::string region;  // empty: all
  Material material;
};

// Each "REGION=material" or "material" for all; material: as parse_material reads it.
std::vector<RegionMaterial> parse_region_materials(const std::vector<std::string>& texts);

// One a region. Where the file has cell arrays "young" and "poisson", one a tetrahedron, with those of the
// given regions replaced; density 1000 kg/m3 where it has none. Throws Error(usage) for a region that is not
// there or has no material, or where only one of the arrays is there; Error(physics) for values that are no
// material.
std::vector<Material> materials_of(const TetFile& file, const std::vector<RegionMaterial>& given);

}  // namespace palpate
