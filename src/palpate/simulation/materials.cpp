#include "palpate/simulation/materials.hpp"

#include <fmt/ranges.h>

#include "palpate/base/error.hpp"
#include "palpate/elasticity/tissues.hpp"

namespace palpate {

std::vector<RegionMaterial> parse_region_materials(const std::vector<std::string>& texts) {
  std::vector<RegionMaterial> out;
  for (const std::string& text : texts) {
    const std::size_t equals = text.find('=');
    const bool named = equals != std::string::npos;
    out.push_back({named ? text.substr(0, equals) : "",
                   parse_material(named ? text.substr(equals + 1) : text, "material '" + text + "'")});
  }
  return out;
}

std::vector<Material> materials_of(const TetFile& file, const std::vector<RegionMaterial>& given) {
  const std::vector<std::string>& regions = file.mesh.region_names;
  std::vector<const Material*> of(regions.size(), nullptr);
  for (const RegionMaterial& g : given) {
    bool found = false;
    for (std::size_t r = 0; r < regions.size(); ++r)
      if (g.region.empty() || g.region == regions[r]) of[r] = &g.material, found = true;
    if (!found)
      throw Error(ErrorKind::usage, "material of '{}': there is no such region; the mesh has {}", g.region,
                  fmt::join(regions, ", "));
  }
  const bool has_cells = !file.young.empty() && !file.poisson.empty();
  for (std::size_t r = 0; r < of.size() && !has_cells; ++r)
    if (!of[r]) {
      if (file.young.empty() != file.poisson.empty())
        throw Error(
            ErrorKind::usage,
            "the file has a cell array '{}' but none '{}'; add it, or give a material for region '{}'",
            file.young.empty() ? "poisson" : "young", file.young.empty() ? "young" : "poisson", regions[r]);
      throw Error(ErrorKind::usage, "no material for region '{}'; say {}=10e3,0.45 or {}=liver", regions[r],
                  regions[r], regions[r]);
    }
  std::vector<Material> out;
  if (!has_cells) {
    for (const Material* m : of) out.push_back(*m);
    return out;
  }
  // As many tetrahedra as regions: then each region is one, and materials go by region.
  const bool by_region = file.mesh.tets.size() == regions.size();
  out.resize(file.mesh.tets.size());
  for (std::size_t t = 0; t < out.size(); ++t) {
    const auto r = static_cast<std::size_t>(file.mesh.regions[t]);
    Material m{file.young[t], file.poisson[t], file.density.empty() ? 1000.0 : file.density[t]};
    require_valid(m, "cell data of tetrahedron " + std::to_string(t));
    out[by_region ? r : t] = of[r] ? *of[r] : m;
  }
  return out;
}

}  // namespace palpate
