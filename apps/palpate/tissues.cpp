// palpate tissues: what --material knows by name.
#include "palpate/elasticity/tissues.hpp"

#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "commands.hpp"

namespace palpate {

void run_tissues(const Console& console) {
  nlohmann::json list = nlohmann::json::array();
  console.line(fmt::format("{:<13} {:>8}       {:<15} {:>5} {:>6}  {}", "tissue", "E", "range", "nu", "kg/m3",
                           "source of E"));
  for (const Tissue& t : tissues()) {
    const auto [unit, name] = t.typical.young < 1e6   ? std::pair(1e3, "kPa")
                              : t.typical.young < 1e9 ? std::pair(1e6, "MPa")
                                                      : std::pair(1e9, "GPa");
    console.line(fmt::format("{:<13} {:>8.3g} {:<4} {:>5.3g} to {:<7.3g} {:>5} {:>6}  {}", t.name,
                             t.typical.young / unit, name, t.young_low / unit, t.young_high / unit,
                             t.typical.poisson, t.typical.density, t.source));
    list.push_back({{"name", t.name},
                    {"young_pa", t.typical.young},
                    {"young_low_pa", t.young_low},
                    {"young_high_pa", t.young_high},
                    {"poisson", t.typical.poisson},
                    {"density_kg_m3", t.typical.density},
                    {"source", t.source}});
  }
  console.object({{"tissues", list}});
}

}  // namespace palpate
