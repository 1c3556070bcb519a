#include "palpate/picture/picture.hpp"

#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <filesystem>

#include "palpate/base/error.hpp"
#include "palpate/geometry/shapes.hpp"

namespace palpate {
namespace {

struct Pixel {
  int r, g, b;
};

Pixel at(const Image& image, int x, int y) {
  const std::size_t i =
      3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x));
  return {image.rgb[i], image.rgb[i + 1], image.rgb[i + 2]};
}

double difference(const Pixel& a, const Pixel& b) { return std::hypot(a.r - b.r, a.g - b.g, a.b - b.b); }

// A square of this side facing +z.
TriangleMesh square(double side, double z) {
  const double a = side / 2;
  return {{Vec3(-a, -a, z), Vec3(a, -a, z), Vec3(a, a, z), Vec3(-a, a, z)}, {{0, 1, 2}, {0, 2, 3}}};
}

DrawnMesh drawn(const TriangleMesh& mesh, std::array<float, 3> color, float opacity = 1) {
  DrawnMesh d;
  d.vertices = mesh.vertices, d.triangles = mesh.triangles, d.color = color, d.opacity = opacity;
  return d;
}

constexpr std::array<float, 3> red{1, 0, 0}, green{0, 1, 0};

TEST(Painter, NearerCoversFartherWhateverTheOrder) {
  Painter painter(100, 80);
  const Camera camera;  // one metre along z
  const TriangleMesh far = square(0.2, -0.1), near = square(0.1, 0.1);
  const Image nothing = painter.draw({}, camera, 0, 1);
  for (const auto& meshes :
       {std::vector{drawn(far, red), drawn(near, green)}, std::vector{drawn(near, green), drawn(far, red)}}) {
    const Image image = painter.draw(meshes, camera, 0, 1);
    ASSERT_EQ(image.rgb.size(), 3u * 100 * 80);
    const Pixel centre = at(image, 50, 40), ring = at(image, 50 + 10, 40), corner = at(image, 2, 2);
    EXPECT_GT(centre.g, 2 * centre.r);
    EXPECT_GT(ring.r, 2 * ring.g);
    EXPECT_LT(difference(corner, at(nothing, 2, 2)), 3);
  }
}

TEST(Painter, ASphereIsRoundAlsoInAWidePicture) {
  Painter painter(400, 200);
  const TriangleMesh ball = make_sphere(Vec3::Zero(), 0.05, 60, 120);
  const Image image = painter.draw({drawn(ball, red)}, Camera{}, 0, 1);
  int left = 400, right = -1, top = 200, bottom = -1;
  for (int y = 0; y < 200; ++y)
    for (int x = 0; x < 400; ++x)
      if (const Pixel p = at(image, x, y); p.r > 1.5 * p.b)
        left = std::min(left, x), right = std::max(right, x), top = std::min(top, y),
        bottom = std::max(bottom, y);
  const double width = right - left + 1, height = bottom - top + 1;
  EXPECT_NEAR(width, height, 2);
  // Seen from one metre at 35 degrees: the silhouette's diameter in pixels.
  EXPECT_NEAR(height, 200 * std::tan(std::asin(0.05)) / std::tan(17.5 * M_PI / 180), 3);
  EXPECT_NEAR(left + right, 399, 2);
}

TEST(Painter, ValuesFollowTheScaleAndOpacityBlends) {
  Painter painter(64, 64);
  const TriangleMesh wall = square(2, 0);
  const auto painted = [&](float value) {
    const std::vector<float> values(4, value);
    DrawnMesh d = drawn(wall, red);
    d.values = values;
    return at(painter.draw({d}, Camera{}, 0, 10), 32, 32);
  };
  // Shading changes brightness, not the order: low values are light, high ones dark, beyond the ends they
  // stay.
  const auto brightness = [](const Pixel& p) { return p.r + p.g + p.b; };
  EXPECT_GT(brightness(painted(0)), brightness(painted(5)) + 30);
  EXPECT_GT(brightness(painted(5)), brightness(painted(10)) + 30);
  EXPECT_LT(difference(painted(10), painted(99)), 2);
  EXPECT_LT(difference(painted(0), painted(-99)), 2);
  const TriangleMesh back = square(2, -0.2);
  const Pixel solid = at(painter.draw({drawn(back, red), drawn(wall, green)}, Camera{}, 0, 1), 32, 32);
  const Pixel glass = at(painter.draw({drawn(wall, green, 0.5f), drawn(back, red)}, Camera{}, 0, 1), 32, 32);
  EXPECT_GT(glass.r, solid.r + 40);
  EXPECT_GT(glass.g, 40);
}

TEST(Painter, FrameBoxShowsAllOfTheBox) {
  const Box box{Vec3(-0.3, 2, 1), Vec3(0.4, 2.2, 1.9)};
  for (const Vec3& direction : {Vec3(1, 0, 0), Vec3(1, -1, 0.8), Vec3(0, 0, 1)}) {
    const Camera c = frame_box(box, direction, Vec3(0, 0.1, 1));
    const Vec3 forward = (c.target - c.eye).normalized();
    for (int k = 0; k < 8; ++k) {
      const Vec3 corner(k & 1 ? box.max.x() : box.min.x(), k & 2 ? box.max.y() : box.min.y(),
                        k & 4 ? box.max.z() : box.min.z());
      const double angle = std::acos((corner - c.eye).normalized().dot(forward)) * 180 / M_PI;
      EXPECT_LT(angle, c.field_of_view * 0.71);  // within the picture's corners
    }
  }
}

TEST(Painter, BadMeshesAreNamedErrors) {
  Painter painter(32, 32);
  TriangleMesh mesh = square(1, 0);
  mesh.triangles[0][1] = 7;
  EXPECT_THROW(painter.draw({drawn(mesh, red)}, Camera{}, 0, 1), Error);
  EXPECT_THROW(Painter(0, 10), Error);
  EXPECT_THROW(Painter(1 << 20, 10), Error);
}

TEST(ContactSheet, HasItsTilesCaptionsAndLegend) {
  Image tile{48, 48, std::vector<std::uint8_t>(3 * 48 * 48, 0)};
  const std::vector<Tile> without(5, Tile{tile, ""}), with(5, Tile{tile, "12.3 mm"});
  const Image a = contact_sheet(without, 4, "title", "displacement, mm", 0, 12),
              b = contact_sheet(with, 4, "title", "displacement, mm", 0, 12);
  ASSERT_EQ(a.rgb.size(), 3u * static_cast<std::size_t>(a.width) * static_cast<std::size_t>(a.height));
  ASSERT_EQ(a.width, b.width);
  EXPECT_GE(a.width, 4 * 48);
  EXPECT_GT(a.height, 2 * 48);
  EXPECT_NE(a.rgb, b.rgb);
  std::size_t black = 0;
  for (std::size_t i = 0; i < a.rgb.size(); i += 3) black += a.rgb[i] + a.rgb[i + 1] + a.rgb[i + 2] == 0;
  EXPECT_GE(black, 5u * 48 * 48);
  EXPECT_GT(contact_sheet({}, 4, "", "", 0, 1).height, 0);
}

TEST(Png, ReadsBackTheSamePixels) {
  const auto folder = std::filesystem::temp_directory_path();
  const auto path = folder / "palpate_picture_test.png";
  Image image{5, 3, {}};
  for (int i = 0; i < 45; ++i) image.rgb.push_back(static_cast<std::uint8_t>(5 * i));
  write_png(path, image);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  ASSERT_TRUE(png_image_begin_read_from_file(&png, path.c_str()));
  png.format = PNG_FORMAT_RGB;
  EXPECT_EQ(png.width, 5u);
  EXPECT_EQ(png.height, 3u);
  std::vector<std::uint8_t> rgb(PNG_IMAGE_SIZE(png));
  ASSERT_TRUE(png_image_finish_read(&png, nullptr, rgb.data(), 0, nullptr));
  EXPECT_EQ(rgb, image.rgb);
  std::filesystem::remove(path);
  EXPECT_THROW(write_png(folder / "palpate_no_such_folder" / "x.png", image), Error);
}

}  // namespace
}  // namespace palpate
