#include "palpate/elasticity/tissues.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <vector>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {

constexpr const char* arda = "Arda et al. 2011, AJR 197:532, shear waves, 127 people";
constexpr const char* samani =
    "Samani, Zubovits, Plewes 2007, Phys. Med. Biol. 52:1565, indentation, ex vivo";
constexpr const char* budday =
    "Budday et al. 2015, J. Mech. Behav. Biomed. Mater. 46:318, indentation, bovine";

constexpr std::array<Tissue, 16> table{{
    {"liver",
     {5.5e3, 0.49, 1060},
     3.9e3,
     7.1e3,
     "Roulot et al. 2008, J. Hepatol. 48:606, shear waves, 429 people"},
    {"kidney", {5.0e3, 0.49, 1050}, 2.1e3, 7.9e3, arda},  // cortex
    {"renal pelvis", {23.6e3, 0.49, 1050}, 18.2e3, 29.0e3, arda},
    {"spleen", {2.9e3, 0.49, 1060}, 1.1e3, 4.7e3, arda},
    {"pancreas", {4.8e3, 0.49, 1040}, 1.8e3, 7.8e3, arda},
    {"thyroid", {11.0e3, 0.49, 1050}, 7.9e3, 14.1e3, arda},
    {"muscle", {11.1e3, 0.49, 1050}, 7.0e3, 15.2e3, arda},   // gastrocnemius, relaxed
    {"tendon", {51.5e3, 0.49, 1120}, 26.4e3, 76.6e3, arda},  // Achilles
    {"grey matter", {1.39e3, 0.49, 1040}, 1.10e3, 1.68e3, budday},
    {"white matter", {1.90e3, 0.49, 1040}, 1.30e3, 2.49e3, budday},
    {"fat", {3.25e3, 0.49, 950}, 2.3e3, 4.2e3, samani},  // of the breast
    {"breast gland", {3.24e3, 0.49, 1020}, 2.6e3, 3.9e3, samani},
    {"carcinoma", {42.5e3, 0.49, 1040}, 30e3, 55e3, samani},  // invasive ductal, high grade
    {"artery",
     {0.6e6, 0.49, 1050},
     0.4e6,
     0.9e6,
     "Bergel 1961, J. Physiol. 156:445, dog, incremental at 100 mmHg"},
    {"bone",
     {18.6e9, 0.3, 1920},
     7e9,
     25e9,
     "Rho, Ashman, Turner 1993, J. Biomech. 26:111 (cortical); range: Zysset et al. 1999, J. Biomech. "
     "32:1005"},
    {"stone",
     {2.2e9, 0.3, 1800},
     0.6e9,
     2.2e9,
     "Mohamed Ali, Arunai Nambi Raj 2012, Adv. Mater. Res. 584:494; low: Uchida et al. 1994, ASTM STP18110S"},
}};

}  // namespace

std::span<const Tissue> tissues() { return table; }

Material parse_material(const std::string& text, const std::string& where) {
  for (const Tissue& tissue : table)
    if (text == tissue.name) return tissue.typical;
  std::vector<double> values;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    double v = 0;
    const auto [stop, status] = std::from_chars(text.data() + at, text.data() + end, v);
    if (status != std::errc() || stop != text.data() + end) {
      values.clear();
      break;
    }
    values.push_back(v);
    at = end + 1;
  }
  if (values.size() < 2 || values.size() > 3) {
    std::string names;
    for (const Tissue& tissue : table) names += fmt::format("{}{}", names.empty() ? "" : ", ", tissue.name);
    throw Error(ErrorKind::usage,
                "{}: say E,nu or E,nu,density (Pa, -, kg/m3), as in 10e3,0.45, or a tissue: {}", where,
                names);
  }
  const Material m{values[0], values[1], values.size() > 2 ? values[2] : 1000.0};
  require_valid(m, where);
  return m;
}

}  // namespace palpate
