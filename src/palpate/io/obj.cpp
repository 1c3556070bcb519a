#include "palpate/io/polygon.hpp"
#include "palpate/io/surface_formats.hpp"
#include "palpate/io/text_reader.hpp"

namespace palpate {

namespace {

struct Face {
  std::size_t begin;  // of its corners
  std::size_t line;
};

// "7", "7/1", "7//3", "7/1/3", "-1": the vertex number from 0.
std::int64_t corner(TextReader& in, std::string_view word, std::size_t vertices) {
  const std::int64_t i = in.integer(word.substr(0, word.find('/')));
  if (i == 0) in.fail("vertex 0: vertices are numbered from 1");
  const std::int64_t v = i > 0 ? i - 1 : i + static_cast<std::int64_t>(vertices);
  if (v < 0) in.fail("vertex {}, but only {} vertices come before", i, vertices);
  if (v > std::numeric_limits<Index>::max()) in.fail("vertex {} is not there", i);
  return v;
}

}  // namespace

TriangleMesh read_obj(std::string_view bytes, const std::string& name) {
  if (bytes.substr(0, 3) == "\xef\xbb\xbf") bytes.remove_prefix(3);
  TextReader in(bytes, name, true);
  TriangleMesh mesh;
  std::vector<Index> corners;
  std::vector<Face> faces;
  while (in.next_line()) {
    const std::string_view keyword = in.word();
    if (keyword == "v") {  // x y z, then a weight or a colour
      Vec3 p;
      for (int i = 0; i < 3; ++i) p[i] = in.number(in.word());
      mesh.vertices.push_back(p);
    } else if (keyword == "f") {
      faces.push_back({corners.size(), in.line()});
      for (std::string_view w = in.word(); !w.empty() && w[0] != '#'; w = in.word())
        corners.push_back(static_cast<Index>(corner(in, w, mesh.vertices.size())));
      const std::size_t n = corners.size() - faces.back().begin;
      if (n < 3) in.fail("a face with {} corners", n);
    }
  }
  faces.push_back({corners.size(), 0});
  Triangulator triangulator;
  for (std::size_t f = 0; f + 1 < faces.size(); ++f) {
    const std::span<const Index> face(corners.data() + faces[f].begin, faces[f + 1].begin - faces[f].begin);
    for (const Index v : face)
      if (static_cast<std::size_t>(v) >= mesh.vertices.size())
        throw Error(ErrorKind::format, "{}: line {}: vertex {}, but the file has {}", name, faces[f].line,
                    v + 1, mesh.vertices.size());
    triangulator.add(face, mesh.vertices, mesh.triangles);
  }
  return mesh;
}

}  // namespace palpate
