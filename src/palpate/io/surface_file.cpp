#include "palpate/io/surface_file.hpp"

#include <cmath>
#include <cstring>

#include "palpate/base/error.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/io/importer.hpp"
#include "palpate/io/surface_formats.hpp"

namespace palpate {

namespace fs = std::filesystem;

namespace {

std::string lower_extension(const fs::path& path) {
  std::string e = path.extension().string();
  for (char& c : e) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return e;
}

template <class T>
void put(std::string& out, const T& value) {  // little endian, as all machines this runs on
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  out.append(bytes, sizeof(T));
}

std::string as_obj(const TriangleMesh& mesh, double unit) {
  std::string out;
  for (const Vec3& v : mesh.vertices)  // shortest digits that read back to the same double
    out += fmt::format("v {} {} {}\n", v.x() / unit, v.y() / unit, v.z() / unit);
  for (const Triangle& t : mesh.triangles) out += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return out;
}

std::string as_stl(const TriangleMesh& mesh, double unit) {
  std::string out("binary STL");  // not "solid", which announces text
  out.resize(80, ' ');
  put(out, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const Triangle& t : mesh.triangles) {
    const Vec3 n = area_vector(mesh, t).stableNormalized();
    for (int i = 0; i < 3; ++i) put(out, static_cast<float>(n[i]));
    for (const Index v : t)
      for (int i = 0; i < 3; ++i)
        put(out, static_cast<float>(mesh.vertices[static_cast<std::size_t>(v)][i] / unit));
    put(out, std::uint16_t{0});
  }
  return out;
}

std::string as_ply(const TriangleMesh& mesh, double unit) {
  std::string out = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\n"
      "property double z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
      mesh.vertices.size(), mesh.triangles.size());
  for (const Vec3& v : mesh.vertices)
    for (int i = 0; i < 3; ++i) put(out, v[i] / unit);
  for (const Triangle& t : mesh.triangles) {
    put(out, std::uint8_t{3});
    for (const Index v : t) put(out, v);
  }
  return out;
}

}  // namespace

double unit_in_metres(std::string_view unit) {
  static constexpr std::pair<std::string_view, double> known[] = {
      {"m", 1}, {"cm", 1e-2}, {"mm", 1e-3}, {"um", 1e-6}, {"in", 0.0254}, {"ft", 0.3048}};
  for (const auto& [name, metres] : known)
    if (unit == name) return metres;
  throw Error(ErrorKind::usage, "unknown unit \"{}\"; known: m, cm, mm, um, in, ft", unit);
}

namespace {

// Content first, extension second.
Imported read_any(const fs::path& path) {
  const std::string name = path.string(), extension = lower_extension(path);
  const std::string bytes = read_file(path);
  const auto begins = [&](std::string_view start) { return bytes.compare(0, start.size(), start) == 0; };
  if (bytes.empty()) throw Error(ErrorKind::format, "{}: the file is empty", name);
  if (begins("ply\n") || begins("ply\r")) return {read_ply(bytes, name), "PLY"};
  if (begins("#Inventor V") || begins("#VRML V") || begins("glTF")) return import_surface(path);
  if (looks_like_stl(bytes) || extension == ".stl") return {read_stl(bytes, name), "STL"};
  if (extension == ".obj") return {read_obj(bytes, name), "Wavefront OBJ"};
  if (extension == ".ply") return {read_ply(bytes, name), "PLY"};
  if (extension == ".gltf" || extension == ".iv" || extension == ".wrl") return import_surface(path);
  throw Error(ErrorKind::format,
              "{}: no surface format that is known here (.iv .wrl .obj .stl .ply .glb .gltf)", name);
}

}  // namespace

void require_polygons(const TriangleMesh& mesh, const std::string& name, const std::string& format) {
  if (mesh.triangles.empty()) throw Error(ErrorKind::format, "{}: no polygons in it ({})", name, format);
  const double most = std::numeric_limits<float>::max();
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (const Index v : mesh.triangles[i]) {
      if (v < 0 || static_cast<std::size_t>(v) >= mesh.vertices.size())
        throw Error(ErrorKind::format, "{}: triangle {} uses vertex {} of {}", name, i, v,
                    mesh.vertices.size());
      const Vec3& p = mesh.vertices[static_cast<std::size_t>(v)];
      if (!(p.array().abs() <= most).all())  // not a number, or too big for float32
        throw Error(ErrorKind::format, "{}: vertex {} of triangle {} is at ({}, {}, {})", name, v, i, p.x(),
                    p.y(), p.z());
    }
}

SurfaceFile read_surface(const fs::path& path, double unit) {
  Imported imported = read_any(path);
  require_polygons(imported.mesh, path.string(), imported.format);
  SurfaceFile file;
  file.mesh = std::move(imported.mesh), file.format = std::move(imported.format);
  for (Vec3& v : file.mesh.vertices) v *= unit;
  const std::size_t triangles = file.mesh.triangles.size();
  file.weld = weld(file.mesh);
  if (file.mesh.triangles.empty())
    throw Error(ErrorKind::format, "{}: none of its {} triangles has an area", path.string(), triangles);
  return file;
}

void write_surface(const fs::path& path, const TriangleMesh& mesh, double unit) {
  const std::string extension = lower_extension(path);
  const auto encode = extension == ".obj"   ? as_obj
                      : extension == ".stl" ? as_stl
                      : extension == ".ply" ? as_ply
                                            : nullptr;
  if (!encode) throw Error(ErrorKind::usage, "{}: surfaces are written as .obj, .stl or .ply", path.string());
  AtomicFile file(path);
  file.write(encode(mesh, unit));
  file.commit();
}

}  // namespace palpate
