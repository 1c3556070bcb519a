// Pictures without a display: Mesa through EGL, surfaceless (DESIGN 4). Shaded triangles, colour by a value,
// a legend, PNG.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "palpate/geometry/triangle_mesh.hpp"

namespace palpate {

struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  // rows from the top
};

struct DrawnMesh {
  std::span<const Vec3> vertices;  // m, world
  std::span<const Triangle> triangles;
  std::span<const float> values;  // a value a vertex, coloured by the scale; empty: `color`
  std::array<float, 3> color{0.75f, 0.75f, 0.78f};
  float opacity = 1;  // below 1 drawn last, blended
};

struct Camera {
  Vec3 eye = Vec3(0, 0, 1), target = Vec3::Zero(), up = Vec3(0, 1, 0);
  double field_of_view = 35;  // degrees, vertical
};
// Looks from `direction` so that all of the points, or the box, are visible and fill the square.
Camera frame_points(std::span<const Vec3> points, const Vec3& direction, const Vec3& up);
Camera frame_box(const Box& box, const Vec3& direction, const Vec3& up);

// One offscreen context; used by one thread. Throws Error(resource) with what to install when EGL is not to
// be had.
class Painter {
 public:
  Painter(int width, int height);
  ~Painter();
  Image draw(const std::vector<DrawnMesh>& meshes, const Camera& camera, double value_min, double value_max);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Perceptually even colours for a fraction 0..1.
std::array<std::uint8_t, 3> color_scale(double fraction);

struct Tile {
  Image image;
  std::string caption;
};
// Tiles in rows of `columns`, captions below each, a title above and a legend with ticks (`unit`: "mm") at
// the bottom.
Image contact_sheet(const std::vector<Tile>& tiles, int columns, const std::string& title,
                    const std::string& legend, double value_min, double value_max);

void write_png(const std::filesystem::path& path, const Image& image);

}  // namespace palpate
