#include "palpate/lattice/lattice_file.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "palpate/io/atomic_file.hpp"
#include "palpate/io/container.hpp"
#include "palpate/lattice/band_lattice.hpp"

namespace palpate {

namespace {

constexpr int version = 1;
const char* const band_kind = "band lattice";

std::span<const double> flat(const std::vector<Vec3>& v) {
  return {reinterpret_cast<const double*>(v.data()), 3 * v.size()};
}
std::span<double> flat(std::vector<Vec3>& v) { return {reinterpret_cast<double*>(v.data()), 3 * v.size()}; }

bool usable(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double x) { return std::abs(x) < 1e30; });
}

// What both kinds begin with.
struct Head {
  Grid grid;  // without n
  SignMethod sign = SignMethod::pseudonormal;
};
Head read_head(const ContainerReader& in, const std::filesystem::path& path) {
  const auto refuse = [&](const char* why) { throw Error(ErrorKind::format, "{}: {}", path.string(), why); };
  Head head;
  head.grid.origin = {in.number("origin_x"), in.number("origin_y"), in.number("origin_z")};
  head.grid.h = in.number("spacing");
  if (!(head.grid.h > 1e-30 && head.grid.h < 1e30) || !usable({head.grid.origin.data(), 3}))
    refuse("origin or spacing of the lattice is no usable number");
  const std::string sign = in.text("sign");
  if (sign != name(SignMethod::pseudonormal) && sign != name(SignMethod::winding))
    refuse("sign of the lattice is neither by pseudonormal nor by winding number");
  if (sign == name(SignMethod::winding)) head.sign = SignMethod::winding;
  return head;
}

TriangleMesh read_surface_of(const ContainerReader& in, const std::filesystem::path& path) {
  const auto refuse = [&](const char* why) { throw Error(ErrorKind::format, "{}: {}", path.string(), why); };
  TriangleMesh surface;
  const std::vector<std::size_t> vertices = in.shape("surface/vertices"),
                                 triangles = in.shape("surface/triangles");
  if (vertices.size() != 2 || vertices[1] != 3 || triangles.size() != 2 || triangles[1] != 3 ||
      vertices[0] > (1u << 31) - 1)
    refuse("the surface is not rows of three");
  surface.vertices.resize(vertices[0]);
  in.array<double>("surface/vertices", flat(surface.vertices));
  const std::vector<Index> corners = in.vector<Index>("surface/triangles");
  if (!usable(flat(surface.vertices)) || std::any_of(corners.begin(), corners.end(), [&](Index v) {
        return v < 0 || static_cast<std::size_t>(v) >= vertices[0];
      }))
    refuse("the surface has a coordinate or an index out of range");
  for (std::size_t i = 0; i < corners.size(); i += 3)
    surface.triangles.push_back({corners[i], corners[i + 1], corners[i + 2]});
  return surface;
}

LatticeFile read_container(const std::filesystem::path& path) {
  const ContainerReader in(path, "lattice", version);
  const auto refuse = [&](const char* why) { throw Error(ErrorKind::format, "{}: {}", path.string(), why); };
  LatticeFile file;
  file.provenance = in.text("provenance");
  const Head head = read_head(in, path);
  Grid& grid = file.samples.grid;
  grid = head.grid;
  file.samples.sign = head.sign;
  const std::vector<std::size_t> shape = in.shape("distance");
  if (shape.size() != 3 ||
      std::any_of(shape.begin(), shape.end(), [](std::size_t n) { return n < 2 || n > (1u << 20); }))
    refuse("the distances are not a grid of two points or more a side");
  for (std::size_t k = 0; k < 3; ++k) grid.n[k] = static_cast<std::int32_t>(shape[k]);
  if (in.shape("closest") != std::vector<std::size_t>{shape[0], shape[1], shape[2], 3})
    refuse("distances and closest points have different shapes");
  file.samples.distance = in.vector<double>("distance");
  file.samples.closest.resize(grid.size());
  in.array<double>("closest", flat(file.samples.closest));
  if (!usable(file.samples.distance) || !usable(flat(file.samples.closest)))
    refuse("a distance or closest point is no usable number");

  for (const std::int64_t number : in.vector<std::int64_t>("touching/number")) {
    auto& touching = file.samples.touching;
    if (number < 0 || static_cast<std::size_t>(number) >= grid.size() ||
        (!touching.empty() && static_cast<std::size_t>(number) <= touching.back()))
      refuse("the grid points on the surface do not ascend within the grid");
    touching.push_back(static_cast<std::size_t>(number));
  }
  if (in.shape("touching/normal") != std::vector<std::size_t>{file.samples.touching.size(), 3})
    refuse("the grid points on the surface have no normals");
  file.samples.touching_normal.resize(file.samples.touching.size());
  in.array<double>("touching/normal", flat(file.samples.touching_normal));
  for (const Vec3& n : file.samples.touching_normal)
    if (!(std::abs(n.norm() - 1) < 1e-6)) refuse("a normal is not of unit length");

  file.surface = read_surface_of(in, path);
  return file;
}

void write_head(ContainerWriter& out, const Grid& grid, SignMethod sign, const std::string& provenance) {
  out.attribute("provenance", provenance);
  out.attribute("origin_x", grid.origin.x());
  out.attribute("origin_y", grid.origin.y());
  out.attribute("origin_z", grid.origin.z());
  out.attribute("spacing", grid.h);
  out.attribute("sign", std::string(name(sign)));
}

void write_surface_of(ContainerWriter& out, const TriangleMesh& surface) {
  out.array<double>("surface/vertices", flat(surface.vertices), {surface.vertices.size(), 3}, "m",
                    "vertices of the surface it was made of");
  const std::span<const Index> corners(surface.triangles.empty() ? nullptr : surface.triangles[0].data(),
                                       3 * surface.triangles.size());
  out.array<Index>("surface/triangles", corners, {surface.triangles.size(), 3}, "1",
                   "corners of its triangles, counter-clockwise seen from outside as given");
}

}  // namespace

void write_lattice(const std::filesystem::path& path, const LatticeSamples& samples,
                   const TriangleMesh& surface, const std::string& provenance) {
  const Grid& grid = samples.grid;
  const std::array<std::size_t, 3> n{static_cast<std::size_t>(grid.n[0]), static_cast<std::size_t>(grid.n[1]),
                                     static_cast<std::size_t>(grid.n[2])};
  ContainerWriter out(path, "lattice", version);
  write_head(out, grid, samples.sign, provenance);
  out.array<double>("distance", samples.distance, {n[0], n[1], n[2]}, "m",
                    "signed distance at origin + spacing (i, j, k), negative inside");
  out.array<double>("closest", flat(samples.closest), {n[0], n[1], n[2], 3}, "m",
                    "closest point of the surface");
  const std::vector<std::int64_t> numbers(samples.touching.begin(), samples.touching.end());
  out.array<std::int64_t>("touching/number", numbers, {numbers.size()}, "1",
                          "grid points on the surface itself, z fastest");
  out.array<double>("touching/normal", flat(samples.touching_normal), {numbers.size(), 3}, "1",
                    "the surface's pseudonormal there");
  write_surface_of(out, surface);
  out.commit();
}

void write_band(const std::filesystem::path& path, const BandSamples& samples, const TriangleMesh& surface,
                const std::string& provenance) {
  const std::size_t slots = samples.slots(), side = brick;
  const std::vector<std::size_t> bricks(samples.bricks.begin(), samples.bricks.end());
  ContainerWriter out(path, band_kind, version);
  write_head(out, samples.grid, samples.sign, provenance);
  out.attribute("band", samples.band);
  for (std::size_t a = 0; a < 3; ++a)
    out.attribute(
        std::string("points_") + "xyz" [a], std::int64_t { samples.grid.n[a] });
  out.array<double>("center", samples.center, bricks, "m",
                    "signed distance at each brick's centre, negative inside");
  out.array<std::int32_t>("slot", samples.slot, bricks, "1",
                          "where each brick's samples are, -1: it has none");
  out.array<double>("distance", samples.distance, {slots, side, side, side}, "m",
                    "signed distance at origin + spacing (8 brick + (i, j, k))");
  out.array<double>("closest", flat(samples.closest), {slots, side, side, side, 3}, "m",
                    "closest point of the surface");
  out.array<double>("gradient", flat(samples.gradient), {slots, side, side, side, 3}, "1",
                    "of the distance, unit length");
  write_surface_of(out, surface);
  out.commit();
}

bool is_band_file(const std::filesystem::path& path) { return container_kind(path) == band_kind; }

BandFile read_band(const std::filesystem::path& path) {
  const ContainerReader in(path, band_kind, version);
  const auto refuse = [&](const char* why) { throw Error(ErrorKind::format, "{}: {}", path.string(), why); };
  BandFile file;
  BandSamples& s = file.samples;
  file.provenance = in.text("provenance");
  const Head head = read_head(in, path);
  s.grid = head.grid, s.sign = head.sign, s.band = in.number("band");
  if (!(s.band >= s.grid.h && s.band < 1e30)) refuse("the band is narrower than the spacing, or no number");
  std::vector<std::size_t> bricks;
  for (std::size_t a = 0; a < 3; ++a) {
    const std::int64_t n = in.integer(std::string("points_") + "xyz"[a]);
    if (n < 2 || n > 1 << 20) refuse("the lattice is no grid of two points or more a side");
    s.grid.n[a] = static_cast<std::int32_t>(n);
    s.bricks[a] = static_cast<std::int32_t>((n + brick - 1) / brick);
    bricks.push_back(static_cast<std::size_t>(s.bricks[a]));
  }
  if (in.shape("center") != bricks || in.shape("slot") != bricks) refuse("the bricks do not cover the grid");
  const std::vector<std::size_t> shape = in.shape("distance");
  const std::size_t side = brick;
  if (shape.size() != 4 || shape != std::vector<std::size_t>{shape[0], side, side, side} ||
      shape[0] > 1u << 22)
    refuse("the samples are not bricks of 8 x 8 x 8");
  const std::vector<std::size_t> vectors{shape[0], side, side, side, 3};
  if (in.shape("closest") != vectors || in.shape("gradient") != vectors)
    refuse("distances, closest points and gradients have different shapes");
  s.center = in.vector<double>("center");
  s.slot = in.vector<std::int32_t>("slot");
  s.distance = in.vector<double>("distance");
  s.closest.resize(s.distance.size()), s.gradient.resize(s.distance.size());
  in.array<double>("closest", flat(s.closest));
  in.array<double>("gradient", flat(s.gradient));
  if (!usable(s.center) || !usable(s.distance) || !usable(flat(s.closest)) || !usable(flat(s.gradient)))
    refuse("a distance, closest point or gradient is no usable number");
  std::int64_t next = 0;
  for (const std::int32_t slot : s.slot)
    if (slot != -1 && slot != next++) refuse("the bricks' samples are not in order");
  if (next != static_cast<std::int64_t>(shape[0])) refuse("some samples belong to no brick");
  for (const Vec3& g : s.gradient)
    if (!(std::abs(g.norm() - 1) < 1e-6)) refuse("a gradient is not of unit length");
  file.surface = read_surface_of(in, path);
  return file;
}

LatticeFile read_lattice(const std::filesystem::path& path) {
  if (is_band_file(path))
    throw Error(ErrorKind::format, "{}: a band of a lattice, where a whole one is wanted", path.string());
  if (!container_kind(path).empty()) return read_container(path);
  const std::string text = read_file(path);
  if (text.find('\0') != std::string::npos)
    throw Error(ErrorKind::format, "{}: neither a palpate lattice (HDF5) nor the text form", path.string());
  LatticeFile file;
  file.samples = parse_lattice_text(text, path.string());
  file.provenance = path.filename().string();
  return file;
}

void write_lattice_vti(const std::filesystem::path& path, const LatticeSamples& samples) {
  static_assert(std::endian::native == std::endian::little);
  const Grid& grid = samples.grid;
  const std::size_t points = grid.size();
  const std::string extent = fmt::format("0 {} 0 {} 0 {}", grid.n[0] - 1, grid.n[1] - 1, grid.n[2] - 1);
  AtomicFile file(path);
  file.write(fmt::format(
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
      "<ImageData WholeExtent=\"{0}\" Origin=\"{1:.17g} {2:.17g} {3:.17g}\" "
      "Spacing=\"{4:.17g} {4:.17g} {4:.17g}\">\n<Piece Extent=\"{0}\">\n<PointData Scalars=\"distance\">\n"
      "<DataArray type=\"Float32\" Name=\"distance\" format=\"appended\" offset=\"0\"/>\n"
      "<DataArray type=\"Float32\" Name=\"closest\" NumberOfComponents=\"3\" format=\"appended\" "
      "offset=\"{5}\"/>\n"
      "</PointData>\n</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">\n_",
      extent, grid.origin.x(), grid.origin.y(), grid.origin.z(), grid.h, 8 + 4 * points));
  // VTK counts x fastest.
  const auto write_array = [&](std::size_t components, const auto& value) {
    const std::uint64_t bytes = 4 * components * points;
    file.write({reinterpret_cast<const char*>(&bytes), sizeof bytes});
    std::vector<float> row;
    for (int k = 0; k < grid.n[2]; ++k)
      for (int j = 0; j < grid.n[1]; ++j) {
        row.clear();
        for (int i = 0; i < grid.n[0]; ++i)
          for (std::size_t c = 0; c < components; ++c)
            row.push_back(static_cast<float>(value(grid.number({i, j, k}), c)));
        file.write({reinterpret_cast<const char*>(row.data()), 4 * row.size()});
      }
  };
  write_array(1, [&](std::size_t at, std::size_t) { return samples.distance[at]; });
  write_array(3, [&](std::size_t at, std::size_t c) { return samples.closest[at][static_cast<int>(c)]; });
  file.write("\n</AppendedData>\n</VTKFile>\n");
  file.commit();
}

}  // namespace palpate
