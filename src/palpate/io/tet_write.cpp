// Writers of tetrahedral meshes. Numbers get the fewest digits that read back to the same double.
#include <fmt/format.h>

#include <charconv>

#include "palpate/base/error.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/io/tet_file.hpp"
#include "palpate/io/tet_formats.hpp"
#include "palpate/io/vtu.hpp"

namespace palpate {

namespace fs = std::filesystem;

std::vector<std::int64_t> region_tags(const TetMesh& mesh) {
  std::vector<std::int64_t> tags;
  for (const std::string& name : mesh.region_names) {
    std::int64_t n = -1;
    if (name.rfind("region ", 0) == 0) {
      const char* end = name.data() + name.size();
      if (std::from_chars(name.data() + 7, end, n).ptr != end || n > 1 << 30) n = -1;
    }
    if (n < 1 || (!tags.empty() && n <= tags.back())) {
      tags.resize(mesh.region_names.size());
      for (std::size_t i = 0; i < tags.size(); ++i) tags[i] = static_cast<std::int64_t>(i + 1);
      return tags;
    }
    tags.push_back(n);
  }
  return tags;
}

namespace {

// Text, handed on in large pieces.
class Text {
 public:
  explicit Text(AtomicFile& file) : file_(file) {}
  template <class... Args>
  void add(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(buffer_), format, std::forward<Args>(args)...);
    if (buffer_.size() > 1 << 20) flush();
  }
  void add(const Vec3& p, const char* end) { add("{} {} {}{}", p.x(), p.y(), p.z(), end); }
  void flush() {
    file_.write({buffer_.data(), buffer_.size()});
    buffer_.clear();
  }

 private:
  AtomicFile& file_;
  fmt::memory_buffer buffer_;
};

std::size_t region_of(const TetMesh& mesh, std::size_t tet) {
  return static_cast<std::size_t>(mesh.regions[tet]);
}

void write_gmsh(const fs::path& path, const TetMesh& mesh) {
  AtomicFile file(path);
  Text out(file);
  const std::vector<std::int64_t> tags = region_tags(mesh);
  out.add("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n{}\n", tags.size());
  for (std::size_t r = 0; r < tags.size(); ++r) {
    std::string name = mesh.region_names[r];
    std::replace(name.begin(), name.end(), '\n', ' ');
    out.add("3 {} \"{}\"\n", tags[r], name);
  }
  out.add("$EndPhysicalNames\n$Nodes\n{}\n", mesh.nodes.size());
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) out.add("{} ", i + 1), out.add(mesh.nodes[i], "\n");
  out.add("$EndNodes\n$Elements\n{}\n", mesh.tets.size());
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    const auto& [a, b, c, d] = mesh.tets[i];
    const std::int64_t tag = tags[region_of(mesh, i)];
    out.add("{} 4 2 {} {} {} {} {} {}\n", i + 1, tag, tag, a + 1, b + 1, c + 1, d + 1);
  }
  out.add("$EndElements\n");
  out.flush();
  file.commit();
}

void write_medit(const fs::path& path, const TetMesh& mesh) {
  AtomicFile file(path);
  Text out(file);
  const std::vector<std::int64_t> tags = region_tags(mesh);
  out.add("MeshVersionFormatted 2\nDimension 3\n");
  out.add("Vertices\n{}\n", mesh.nodes.size());
  for (const Vec3& p : mesh.nodes) out.add(p, " 0\n");
  out.add("Tetrahedra\n{}\n", mesh.tets.size());
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    const auto& [a, b, c, d] = mesh.tets[i];
    out.add("{} {} {} {} {}\n", a + 1, b + 1, c + 1, d + 1, tags[region_of(mesh, i)]);
  }
  out.add("End\n");
  out.flush();
  file.commit();
}

// White space, % and what is not printable as % and two hexadecimal digits.
std::string percent_encoded(const std::string& text) {
  std::string out;
  for (const char c : text)
    out += c > 0x20 && c < 0x7f && c != '%' && c != '"'
               ? std::string(1, c)
               : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  return out;
}

void write_vtk_legacy(const fs::path& path, const TetMesh& mesh) {
  AtomicFile file(path);
  Text out(file);
  // Names of regions go into the title where they fit: not all readers take the field of strings.
  std::string title = "regions:";
  bool fits = true;
  for (const std::string& name : mesh.region_names) {
    title += ' ';
    title += percent_encoded(name);
    fits = fits && !name.empty() && title.size() < 256;
  }
  out.add("# vtk DataFile Version 3.0\n{}\nASCII\nDATASET UNSTRUCTURED_GRID\n", fits ? title : "tetrahedra");
  if (!fits) {
    out.add("FIELD FieldData 1\nregion_names 1 {} string\n", mesh.region_names.size());
    for (const std::string& name : mesh.region_names) out.add("{}\n", percent_encoded(name));
  }
  out.add("POINTS {} double\n", mesh.nodes.size());
  for (const Vec3& p : mesh.nodes) out.add(p, "\n");
  out.add("CELLS {} {}\n", mesh.tets.size(), 5 * mesh.tets.size());
  for (const auto& [a, b, c, d] : mesh.tets) out.add("4 {} {} {} {}\n", a, b, c, d);
  out.add("CELL_TYPES {}\n", mesh.tets.size());
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) out.add("10\n");
  out.add("CELL_DATA {}\nSCALARS region int 1\nLOOKUP_TABLE default\n", mesh.tets.size());
  for (const Index r : mesh.regions) out.add("{}\n", r);
  out.flush();
  file.commit();
}

void write_tetgen(const fs::path& path, const TetMesh& mesh) {
  AtomicFile nodes(fs::path(path).replace_extension(".node")),
      elements(fs::path(path).replace_extension(".ele"));
  Text out(nodes), list(elements);
  const std::vector<std::int64_t> tags = region_tags(mesh);
  out.add("{} 3 0 0\n", mesh.nodes.size());
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) out.add("{} ", i), out.add(mesh.nodes[i], "\n");
  list.add("{} 4 1\n", mesh.tets.size());
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    const auto& [a, b, c, d] = mesh.tets[i];
    list.add("{} {} {} {} {} {}\n", i, a, b, c, d, tags[region_of(mesh, i)]);
  }
  out.flush(), list.flush();
  elements.commit();
  nodes.commit();
}

void require_consistent(const std::string& file, const TetMesh& mesh) {
  const auto inside = [](Index i, std::size_t n) { return i >= 0 && static_cast<std::size_t>(i) < n; };
  bool good = mesh.regions.size() == mesh.tets.size();
  for (std::size_t i = 0; good && i < mesh.tets.size(); ++i) {
    good = inside(mesh.regions[i], mesh.region_names.size());
    for (const Index v : mesh.tets[i]) good = good && inside(v, mesh.nodes.size());
  }
  if (!good) throw Error(ErrorKind::internal, "{}: not written: the mesh refers to what is not there", file);
}

}  // namespace

void write_tets(const fs::path& path, const TetMesh& mesh, double unit) {
  require_consistent(path.string(), mesh);
  TetMesh scaled = mesh;
  if (unit != 1)
    for (Vec3& p : scaled.nodes) p /= unit;
  const std::string extension = path.extension().string();
  if (extension == ".msh") return write_gmsh(path, scaled);
  if (extension == ".mesh") return write_medit(path, scaled);
  if (extension == ".vtk") return write_vtk_legacy(path, scaled);
  if (extension == ".vtu") return write_vtu(path, scaled);
  if (extension == ".node" || extension == ".ele") return write_tetgen(path, scaled);
  throw Error(ErrorKind::usage, "{}: tetrahedra are written as .vtu .msh .mesh .vtk .node, not as \"{}\"",
              path.string(), extension);
}

}  // namespace palpate
