// CalculiX CrunchiX user's manual (Dhondt): input deck format.
#include "palpate/elasticity/calculix.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>

#include "palpate/base/error.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "palpate/io/atomic_file.hpp"

namespace palpate {

namespace {

void require_sizes(const TetMesh& mesh, const ElementNodes& nodes, const std::vector<Material>& materials,
                   const std::vector<std::uint8_t>& anchored) {
  require_valid(mesh, "CalculiX deck");
  require_valid(mesh, materials);
  if (anchored.size() != nodes.size())
    throw Error(ErrorKind::internal, "CalculiX deck: anchor flags for {} nodes of {}", anchored.size(),
                nodes.size());
}

bool any(const std::vector<std::uint8_t>& flags) {
  return std::any_of(flags.begin(), flags.end(), [](std::uint8_t f) { return f != 0; });
}

// A name may hold anything; a comment must stay on its line.
std::string printable(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return c < ' '; }, ' ');
  return name.substr(0, 60);
}

// Tetrahedra of one section: of a region, or of those that share a material.
struct Section {
  Material material;
  std::vector<std::size_t> tets;
};

std::vector<Section> sections_of(const TetMesh& mesh, const std::vector<Material>& materials) {
  std::vector<Section> sections;
  if (materials.size() == mesh.region_names.size()) {
    for (const Material& m : materials) sections.push_back({m, {}});
    for (std::size_t e = 0; e < mesh.tets.size(); ++e)
      sections[static_cast<std::size_t>(mesh.regions[e])].tets.push_back(e);
    return sections;
  }
  std::map<std::array<double, 3>, std::size_t> of;
  for (std::size_t e = 0; e < mesh.tets.size(); ++e) {
    const Material& m = materials[e];
    const auto [it, added] = of.try_emplace({m.young, m.poisson, m.density}, sections.size());
    if (added) sections.push_back({m, {}});
    sections[it->second].tets.push_back(e);
  }
  return sections;
}

}  // namespace

std::string calculix_model(const TetMesh& mesh, const ElementNodes& nodes,
                           const std::vector<Material>& materials,
                           const std::vector<std::uint8_t>& anchored) {
  require_sizes(mesh, nodes, materials, anchored);
  std::string deck;
  const auto out = std::back_inserter(deck);
  fmt::format_to(out, "** metres, newtons, pascals\n*NODE, NSET=NALL\n");
  for (std::size_t i = 0; i < nodes.size(); ++i)
    fmt::format_to(out, "{},{:.12e},{:.12e},{:.12e}\n", i + 1, nodes.positions[i].x(), nodes.positions[i].y(),
                   nodes.positions[i].z());
  const std::vector<Section> sections = sections_of(mesh, materials);
  for (std::size_t r = 0; r < sections.size(); ++r) {
    if (sections[r].tets.empty()) continue;
    const auto region = static_cast<std::size_t>(mesh.regions[sections[r].tets[0]]);
    fmt::format_to(out, "** {}\n*ELEMENT, TYPE={}, ELSET=REGION{}\n", printable(mesh.region_names[region]),
                   nodes.order == 1 ? "C3D4" : "C3D10", r + 1);
    for (const std::size_t e : sections[r].tets) {
      fmt::format_to(out, "{}", e + 1);
      for (const Index v : nodes.of(e)) fmt::format_to(out, ",{}", v + 1);
      fmt::format_to(out, "\n");
    }
    fmt::format_to(out,
                   "*MATERIAL, NAME=MATERIAL{0}\n*ELASTIC\n{1:.12e},{2:.12e}\n*DENSITY\n{3:.12e}\n"
                   "*SOLID SECTION, ELSET=REGION{0}, MATERIAL=MATERIAL{0}\n",
                   r + 1, sections[r].material.young, sections[r].material.poisson,
                   sections[r].material.density);
  }
  if (any(anchored)) {
    fmt::format_to(out, "*NSET, NSET=ANCHOR\n");
    for (std::size_t i = 0; i < anchored.size(); ++i)
      if (anchored[i]) fmt::format_to(out, "{}\n", i + 1);
    fmt::format_to(out, "*BOUNDARY\nANCHOR,1,3\n");
  }
  return deck;
}

void write_calculix(const std::filesystem::path& path, const TetMesh& mesh, const ElementNodes& nodes,
                    const std::vector<Material>& materials, const std::vector<std::uint8_t>& anchored,
                    const std::vector<Vec3>& forces) {
  std::string deck = calculix_model(mesh, nodes, materials, anchored);
  if (!forces.empty() && forces.size() != nodes.size())
    throw Error(ErrorKind::internal, "CalculiX deck: {} forces for {} nodes", forces.size(), nodes.size());
  for (std::size_t i = 0; i < forces.size(); ++i)
    if (!forces[i].allFinite())
      throw Error(ErrorKind::physics, "CalculiX deck: force on node {} is no number", i);
  const auto out = std::back_inserter(deck);
  fmt::format_to(out, "*STEP\n*STATIC\n");
  bool header = false;
  for (std::size_t i = 0; i < forces.size(); ++i)
    for (int a = 0; a < 3; ++a)
      if (const double f = forces[i][a]; f != 0) {
        if (!header) fmt::format_to(out, "*CLOAD\n");
        header = true;
        fmt::format_to(out, "{},{},{:.12e}\n", i + 1, a + 1, f);
      }
  fmt::format_to(out, "*NODE PRINT, NSET=NALL\nU\n");
  if (any(anchored)) fmt::format_to(out, "*NODE PRINT, NSET=ANCHOR, TOTALS=ONLY\nRF\n");
  fmt::format_to(out, "*END STEP\n");
  AtomicFile file(path);
  file.write(deck);
  file.commit();
}

}  // namespace palpate
