#include <charconv>

#include "palpate/io/polygon.hpp"
#include "palpate/io/scanner.hpp"
#include "palpate/io/surface_formats.hpp"

namespace palpate {

namespace {

struct Face {
  std::size_t begin, position;  // of its corners; in the file
};

// "7", "7/1", "7//3", "7/1/3", "-1": the vertex number from 0.
Index corner(Scanner& in, std::size_t vertices) {
  const std::string_view word = in.word(), digits = word.substr(0, word.find('/'));
  std::int64_t i = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), i);
  if (error != std::errc() || end != digits.data() + digits.size() || i == 0)
    in.fail(shown(word) + " is no corner: vertices are numbered from 1, or from -1 backwards");
  const std::int64_t v = i > 0 ? i - 1 : i + static_cast<std::int64_t>(vertices);
  if (v < 0 || v > std::numeric_limits<Index>::max())
    in.fail(fmt::format("there is no vertex {}; {} come before", i, vertices));
  return static_cast<Index>(v);
}

}  // namespace

TriangleMesh read_obj(std::string_view bytes, const std::string& name) {
  if (bytes.substr(0, 3) == "\xef\xbb\xbf") bytes.remove_prefix(3);
  std::string lines;
  if (bytes.find('\n') == bytes.npos) {  // as Macintoshes once ended them
    lines = bytes;
    std::replace(lines.begin(), lines.end(), '\r', '\n');
    bytes = lines;
  }
  Scanner in(name, bytes, '#');
  TriangleMesh mesh;
  std::vector<Index> corners;
  std::vector<Face> faces;
  for (; !in.at_end(); in.line()) {
    const std::string_view keyword = in.word();
    if (keyword == "v") {  // x y z, then a weight or a colour
      Vec3 p;
      for (int i = 0; i < 3; ++i) {
        if (in.line_ends()) in.fail("a vertex without its three coordinates");
        p[i] = in.number();
      }
      mesh.vertices.push_back(p);
    } else if (keyword == "f") {
      faces.push_back({corners.size(), in.position()});
      while (!in.line_ends()) corners.push_back(corner(in, mesh.vertices.size()));
      const std::size_t n = corners.size() - faces.back().begin;
      if (n < 3) in.fail(fmt::format("a face with {} corners", n));
    }
  }
  faces.push_back({corners.size(), 0});
  Triangulator triangulator;
  for (std::size_t f = 0; f + 1 < faces.size(); ++f) {
    const std::span<const Index> face(corners.data() + faces[f].begin, faces[f + 1].begin - faces[f].begin);
    for (const Index v : face)
      if (static_cast<std::size_t>(v) >= mesh.vertices.size()) {
        in.move_to(faces[f].position);
        in.fail(fmt::format("there is no vertex {}; the file has {}", v + 1, mesh.vertices.size()));
      }
    triangulator.add(face, mesh.vertices, mesh.triangles);
  }
  return mesh;
}

}  // namespace palpate
