#include "support/calculix.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>

#include "palpate/base/timer.hpp"
#include "palpate/elasticity/calculix.hpp"
#include "palpate/io/atomic_file.hpp"

namespace palpate::test {

namespace {

// A folder of this run, gone with it.
struct Folder {
  std::filesystem::path path;
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "calculix-XXXXXX").string();
    if (!mkdtemp(name.data())) throw std::runtime_error("cannot make " + name);
    path = name;
  }
  ~Folder() {
    std::error_code ignored;
    if (!std::getenv("PALPATE_KEEP")) std::filesystem::remove_all(path, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
};

bool has_calculix() { return std::system("command -v ccx >/dev/null 2>&1") == 0; }

// Runs job.inp of the folder; the text of job.dat.
std::string run(const Folder& folder, double& seconds) {
  const Timer timer = wall_timer();
  const std::string command =
      fmt::format("cd '{}' && OMP_NUM_THREADS=1 timeout 500 ccx -i job >job.log 2>&1", folder.path.string());
  const int code = std::system(command.c_str());
  seconds = timer.seconds();
  const std::string log = read_file(folder.path / "job.log");
  if (code != 0 || log.find("*ERROR") != log.npos)
    throw std::runtime_error("ccx failed:\n" + log.substr(log.size() < 2000 ? 0 : log.size() - 2000));
  return read_file(folder.path / "job.dat");
}

// The vectors of the last block with this title in job.dat, in the order printed.
std::vector<Vec3> last_block(const std::string& dat, const std::string& title, bool numbered) {
  const std::size_t at = dat.rfind(title);
  if (at == dat.npos) throw std::runtime_error("job.dat has no '" + title + "'");
  std::istringstream lines(dat.substr(at));
  std::string line;
  std::getline(lines, line);
  std::vector<Vec3> result;
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    long node = 0;
    Vec3 v;
    if (numbered) words >> node;
    if (words >> v.x() >> v.y() >> v.z())
      result.push_back(v);
    else if (!result.empty())
      break;
  }
  return result;
}

std::vector<Vec3> displacements(const std::string& dat, std::size_t nodes) {
  std::vector<Vec3> u = last_block(dat, "displacements (vx,vy,vz) for set NALL", true);
  if (u.size() != nodes)
    throw std::runtime_error(fmt::format("{} displacements for {} nodes", u.size(), nodes));
  return u;
}

// The tool as elements: ccx wants faces of solids, so each facet gets a tetrahedron with an apex of its own
// behind it. All their nodes are prescribed, so overlaps do not matter.
void add_tool(std::string& deck, const TetMesh& mesh, const TriangleMesh& tool) {
  const auto out = std::back_inserter(deck);
  const std::size_t first = mesh.nodes.size() + 1, apex = first + tool.vertices.size();
  fmt::format_to(out, "*NODE, NSET=TOOL\n");
  std::size_t number = first;
  const auto add_node = [&](const Vec3& p) {
    fmt::format_to(out, "{},{:.12e},{:.12e},{:.12e}\n", number++, p.x(), p.y(), p.z());
  };
  for (const Vec3& p : tool.vertices) add_node(p);
  const auto vertex = [&](Index v) { return tool.vertices[static_cast<std::size_t>(v)]; };
  for (const Triangle& t : tool.triangles) {
    const Vec3 area = area_vector(tool, t);
    add_node((vertex(t[0]) + vertex(t[1]) + vertex(t[2])) / 3 - area / std::sqrt(area.norm()));
  }
  fmt::format_to(out, "*ELEMENT, TYPE=C3D4, ELSET=TOOL\n");
  for (std::size_t i = 0; i < tool.triangles.size(); ++i) {
    const auto& [a, b, c] = tool.triangles[i];
    fmt::format_to(out, "{},{},{},{},{}\n", mesh.tets.size() + i + 1, first + a, first + c, first + b,
                   apex + i);
  }
  fmt::format_to(out, "*SOLID SECTION, ELSET=TOOL, MATERIAL=MATERIAL1\n*SURFACE, NAME=MASTER\nTOOL,S1\n");
}

// The deck's only material: C10 = mu / 2, D1 = 2 / bulk modulus.
void make_neo_hookean(std::string& deck, const Material& material) {
  const std::size_t begin = deck.find("*ELASTIC\n"), end = deck.find("*DENSITY");
  deck.replace(begin, end - begin,
               fmt::format("*HYPERELASTIC, NEO HOOKE\n{:.12e},{:.12e}\n", material.mu() / 2,
                           2 / (material.lambda() + 2 * material.mu() / 3)));
}

}  // namespace

std::optional<StaticReference> calculix_static(const TetMesh& mesh, const ElementNodes& nodes,
                                               const std::vector<Material>& materials,
                                               const std::vector<std::uint8_t>& anchored,
                                               const std::vector<Vec3>& forces) {
  if (!has_calculix()) return std::nullopt;
  const Folder folder;
  write_calculix(folder.path / "job.inp", mesh, nodes, materials, anchored, forces);
  StaticReference result;
  const std::string dat = run(folder, result.seconds);
  result.displacement = displacements(dat, nodes.size());
  result.reaction = last_block(dat, "total force (fx,fy,fz) for set ANCHOR", false).at(0);
  return result;
}

std::optional<ContactReference> calculix_contact(const TetMesh& mesh, const std::vector<Material>& materials,
                                                 const std::vector<std::uint8_t>& anchored,
                                                 const TriangleMesh& tool, const Vec3& motion, double slope,
                                                 Elasticity elasticity) {
  if (!has_calculix()) return std::nullopt;
  std::string deck = calculix_model(mesh, element_nodes(mesh, 1), materials, anchored);
  add_tool(deck, mesh, tool);
  const auto out = std::back_inserter(deck);
  const char* const step = elasticity == Elasticity::linear ? "" : ", NLGEOM";
  if (elasticity == Elasticity::neo_hooke) make_neo_hookean(deck, materials.at(0));
  fmt::format_to(out, "*NSET, NSET=SKIN\n");
  for (const Index v : boundary(mesh).nodes)
    if (!anchored[static_cast<std::size_t>(v)]) fmt::format_to(out, "{}\n", v + 1);
  fmt::format_to(out,
                 "*SURFACE, NAME=SLAVE, TYPE=NODE\nSKIN\n*SURFACE INTERACTION, NAME=CONTACT\n"
                 "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{:.12e}\n"
                 "*CONTACT PAIR, INTERACTION=CONTACT, TYPE=NODE TO SURFACE\nSLAVE,MASTER\n"
                 "*STEP, INC=1000{}\n*STATIC\n0.1,1.\n*BOUNDARY\n",
                 slope / 1000, step);
  for (int a = 0; a < 3; ++a) fmt::format_to(out, "TOOL,{0},{0},{1:.12e}\n", a + 1, motion[a]);
  // A stiff penalty does not converge while the tool moves: nodes chatter between facets. Once the tool has
  // arrived, each tenfold stiffening takes one or two iterations.
  for (const double s : {slope / 1000, slope / 100, slope / 10, slope}) {
    if (s != slope / 1000)
      fmt::format_to(out,
                     "*STEP, INC=1000{}\n*STATIC\n1.,1.\n*CHANGE SURFACE BEHAVIOR, INTERACTION=CONTACT\n"
                     "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{:.12e}\n",
                     step, s);
    fmt::format_to(out,
                   "*NODE PRINT, NSET=NALL, FREQUENCY=1000\nU\n"
                   "*NODE PRINT, NSET=TOOL, TOTALS=ONLY, FREQUENCY=1000\nRF\n*END STEP\n");
  }
  const Folder folder;
  AtomicFile file(folder.path / "job.inp");
  file.write(deck);
  file.commit();
  ContactReference result;
  const std::string dat = run(folder, result.seconds);
  result.displacement = displacements(dat, mesh.nodes.size());
  result.force =
      -last_block(dat, "total force (fx,fy,fz) for set TOOL", false).at(0);  // printed: on its nodes
  return result;
}

}  // namespace palpate::test
