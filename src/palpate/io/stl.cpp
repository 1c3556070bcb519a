#include <cmath>
#include <cstring>

#include "palpate/io/scanner.hpp"
#include "palpate/io/surface_formats.hpp"

namespace palpate {

namespace {

constexpr std::size_t header_size = 84, record_size = 50;

bool is(std::string_view word, std::string_view lower) {  // some programs write capitals
  if (word.size() != lower.size()) return false;
  for (std::size_t i = 0; i < word.size(); ++i)
    if ((word[i] >= 'A' && word[i] <= 'Z' ? word[i] + ('a' - 'A') : word[i]) != lower[i]) return false;
  return true;
}

std::size_t announced(std::string_view bytes) {
  std::uint32_t count = 0;
  if (bytes.size() >= header_size) std::memcpy(&count, bytes.data() + 80, 4);
  return count;
}

bool exactly_binary(std::string_view bytes) {
  return bytes.size() >= header_size && bytes.size() == header_size + record_size * announced(bytes);
}

// Binary headers may begin with "solid" as well: then there are zero bytes or the size fits exactly.
bool is_text(std::string_view bytes) {
  const std::size_t start = bytes.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  return start != bytes.npos && is(bytes.substr(start, 5), "solid") && !exactly_binary(bytes) &&
         bytes.substr(0, 512).find('\0') == bytes.npos;
}

void add(TriangleMesh& mesh, const std::array<Vec3, 3>& corners) {
  const auto n = static_cast<Index>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), corners.begin(), corners.end());
  mesh.triangles.push_back({n, n + 1, n + 2});
}

TriangleMesh read_binary(std::string_view bytes, const std::string& name) {
  if (bytes.size() < header_size)
    throw Error(ErrorKind::format, "{}: {} bytes are too few for an STL file", name, bytes.size());
  const std::size_t count = announced(bytes), held = (bytes.size() - header_size) / record_size;
  if (count != held)  // up to 49 bytes more are somebody's padding
    throw Error(ErrorKind::format, "{}: says it has {} triangles but holds {}: truncated, or no STL file",
                name, count, held);
  TriangleMesh mesh;
  mesh.vertices.reserve(3 * count), mesh.triangles.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    Eigen::Matrix3f corners;  // by columns
    std::memcpy(corners.data(), bytes.data() + header_size + record_size * i + 12, 36);
    const Mat3 c = corners.cast<double>();
    add(mesh, {c.col(0), c.col(1), c.col(2)});
  }
  return mesh;
}

TriangleMesh read_text(std::string_view bytes, const std::string& name) {
  if (bytes.substr(0, 3) == "\xef\xbb\xbf") bytes.remove_prefix(3);
  Scanner in(name, bytes);
  TriangleMesh mesh;
  const auto expect = [&](std::string_view keyword) {
    const std::string_view w = in.word();
    if (!is(w, keyword)) in.fail(fmt::format("expected \"{}\", found {}", keyword, shown(w)));
  };
  while (!in.at_end()) {
    expect("solid");
    in.line();  // its name
    std::string_view w = in.word();
    for (; is(w, "facet"); w = in.word()) {
      in.at("facet", static_cast<std::int64_t>(mesh.triangles.size()));
      while (!is(in.word(), "outer")) {  // the normal follows from the vertices
      }
      expect("loop");
      std::array<Vec3, 3> corners;
      for (Vec3& p : corners) {
        expect("vertex");
        for (int i = 0; i < 3; ++i) {
          const double x = in.number();
          if (std::abs(x) > std::numeric_limits<float>::max())
            in.fail(fmt::format("{} is beyond float32", x));
          p[i] = static_cast<float>(x);
        }
      }
      expect("endloop"), expect("endfacet");
      add(mesh, corners);
    }
    if (!is(w, "endsolid")) in.fail("expected \"facet\" or \"endsolid\", found " + shown(w));
    in.line();
  }
  return mesh;
}

}  // namespace

bool looks_like_stl(std::string_view bytes) { return exactly_binary(bytes) || is_text(bytes); }

TriangleMesh read_stl(std::string_view bytes, const std::string& name) {
  return is_text(bytes) ? read_text(bytes, name) : read_binary(bytes, name);
}

}  // namespace palpate
