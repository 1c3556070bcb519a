#include "damage.hpp"

#include <cmath>
#include <fstream>
#include <random>

#include "palpate/base/error.hpp"
#include "palpate/io/nifti.hpp"
#include "palpate/io/surface_file.hpp"
#include "palpate/io/surface_formats.hpp"
#include "palpate/io/tet_file.hpp"

namespace palpate {

std::string damaged(std::string bytes, unsigned seed) {
  std::mt19937 random(seed);
  const auto below = [&](std::size_t n) { return n ? random() % n : 0; };
  static const std::string words[] = {"-1",
                                      "0",
                                      "nan",
                                      "1e999",
                                      "99999999999999999999",
                                      "4294967295",
                                      "{",
                                      "}",
                                      "[",
                                      "\n",
                                      " ",
                                      "\\\n",
                                      "#",
                                      "\xff\xff\xff\xff",
                                      "\xff\xff\xff\x7f",
                                      std::string(8, '\0'),
                                      std::string("\0\0\xc0\x7f", 4)};
  for (std::size_t i = 0, n = 1 + below(4); i < n; ++i) {
    const std::size_t at = below(bytes.size()), length = std::min(below(40), bytes.size() - at);
    if (bytes.empty()) break;
    switch (below(7)) {
      case 0:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
        break;
      case 1:
        bytes[at] = static_cast<char>(random());
        break;
      case 2:
        bytes.replace(at, below(5), words[below(std::size(words))]);
        break;
      case 3:
        bytes.insert(at, bytes.substr(at, length));
        break;
      case 4:
        bytes.erase(at, length);
        break;
      case 5:
        std::swap(bytes[at], bytes[below(bytes.size())]);
        break;
      default: {
        const std::string& word = words[below(std::size(words))];
        for (std::size_t k = 0; k < word.size() && at + k < bytes.size(); ++k) bytes[at + k] = word[k];
      }
    }
  }
  return bytes;
}

namespace {

std::string unsound(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) return "no triangles, and no error";
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t)
      if (v < 0 || static_cast<std::size_t>(v) >= mesh.vertices.size()) return "an index out of range";
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t)
      if (!mesh.vertices[static_cast<std::size_t>(v)].allFinite()) return "a vertex that is not finite";
  return "";
}

}  // namespace

std::string read_damaged(const std::filesystem::path& path, const std::string& bytes) {
  const std::string extension = path.extension();
  const auto own = extension == ".obj"   ? read_obj
                   : extension == ".stl" ? read_stl
                   : extension == ".ply" ? read_ply
                                         : nullptr;
  try {
    if (is_label_file(path)) {
      const LabelVolume v = parse_labels(bytes, path);
      return v.labels.size() == v.size[0] * v.size[1] * v.size[2] && v.to_world.allFinite()
                 ? ""
                 : "an unsound volume";
    }
    if (own) {
      const TriangleMesh mesh = own(bytes, path);
      require_polygons(mesh, path, "own");
      return unsound(mesh);
    }
    std::ofstream(path, std::ios::binary) << bytes;
    if (is_tet_file(path)) return read_tets(path).mesh.tets.empty() ? "no tetrahedra, and no error" : "";
    return unsound(read_surface(path).mesh);
  } catch (const Error& e) {
    const std::string text = e.what();
    if (e.kind() != ErrorKind::format && e.kind() != ErrorKind::resource) return "kind of error: " + text;
    return text.find('\n') != text.npos || text.size() > 1000 ? "not one line: " + text : "";
  } catch (const std::exception& e) {
    return std::string("another exception: ") + e.what();
  }
}

}  // namespace palpate
