#include "palpate/picture/picture.hpp"

#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <filesystem>

#include "palpate/base/error.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/picture/corner_normals.hpp"
#include "palpate/picture/text.hpp"

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

TEST(Painter, AWallThatFacesTheCameraHasTheLegendsColours) {
  Painter painter(64, 64);
  const TriangleMesh wall = square(2, 0);
  for (const double fraction : {0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0}) {
    const std::vector<float> values(4, static_cast<float>(3 + 4 * fraction));
    DrawnMesh d = drawn(wall, red);
    d.values = values;
    const std::array<std::uint8_t, 3> c = color_scale(fraction);
    const Pixel p = at(painter.draw({d}, Camera{}, 3, 7), 32, 32);
    EXPECT_LT(difference(p, {c[0], c[1], c[2]}), 8) << fraction;
  }
  // The colour of the mesh where there are no values.
  EXPECT_LT(difference(at(painter.draw({drawn(wall, {0.5f, 0.6f, 0.7f})}, Camera{}, 0, 1), 32, 32),
                       {128, 153, 179}),
            8);
}

TEST(Painter, WhatIsNoNumberIsNotDrawn) {
  Painter painter(64, 64);
  TriangleMesh mesh = square(0.2, 0);
  const Image whole = painter.draw({drawn(mesh, red)}, Camera{}, 0, 1);
  const Index n = static_cast<Index>(mesh.vertices.size());
  mesh.vertices.push_back(Vec3::Constant(std::nan("")));
  mesh.vertices.push_back(Vec3::Constant(std::numeric_limits<double>::infinity()));
  const DrawnMesh nothing;
  EXPECT_EQ(painter.draw({drawn(mesh, red), nothing, drawn({}, red, 0.5f)}, Camera{}, 0, 1).rgb, whole.rgb);
  mesh.triangles.push_back({0, 1, n});
  mesh.triangles.push_back({1, 2, n + 1});
  EXPECT_LT(difference(at(painter.draw({drawn(mesh, red)}, Camera{}, 0, 0), 32, 32), at(whole, 32, 32)), 60);
}

TEST(Painter, SharpEdgesStaySharpAndRoundOnesRound) {
  const TriangleMesh box = make_box({Vec3(-1, -1, -1), Vec3(1, 1, 1)});
  const std::vector<Vec3f> sharp = corner_normals(box.vertices, box.triangles, 35);
  for (std::size_t c = 0; c < sharp.size(); ++c)
    EXPECT_LT((sharp[c].cast<double>() - area_vector(box, box.triangles[c / 3]).normalized()).norm(), 1e-6);
  const TriangleMesh ball = make_sphere(Vec3::Zero(), 1, 24, 48);
  const std::vector<Vec3f> smooth = corner_normals(ball.vertices, ball.triangles, 35);
  for (std::size_t c = 0; c < smooth.size(); ++c)
    EXPECT_LT((smooth[c].cast<double>() - ball.vertices[ball.triangles[c / 3][c % 3]]).norm(), 0.02);
}

TEST(ColorScale, IsEvenAndFallsInLightness) {
  const auto lightness = [](double fraction) {
    const std::array<std::uint8_t, 3> c = color_scale(fraction);
    const auto linear = [](int v) { return std::pow((v / 255.0 + 0.055) / 1.055, 2.4); };
    return std::cbrt(0.2126 * linear(c[0]) + 0.7152 * linear(c[1]) + 0.0722 * linear(c[2]));
  };
  for (int i = 0; i < 20; ++i) {
    const double step = lightness(i / 20.0) - lightness((i + 1) / 20.0);
    EXPECT_GT(step, 0.008) << i;
    EXPECT_LT(step, 0.05) << i;
  }
  EXPECT_EQ(color_scale(-1), color_scale(0));
  EXPECT_EQ(color_scale(std::nan("")), color_scale(0));
  EXPECT_EQ(color_scale(2), color_scale(1));
}

TEST(Text, WidthsAddUpAndInkStaysWithin) {
  EXPECT_EQ(text_width("", 12), 0);
  EXPECT_GT(text_width("W", 12), text_width("i", 12));
  EXPECT_DOUBLE_EQ(text_width("012345", 12), text_width("678999", 12));  // figures are all of one width
  EXPECT_DOUBLE_EQ(text_width("mm", 24), 2 * text_width("mm", 12));
  std::string all;
  for (char c = ' '; c <= '~'; ++c) all += c;
  Image image{1400, 60, std::vector<std::uint8_t>(3 * 1400 * 60, 255)};
  draw_text(image, 20, 40, all + "\xC2\xB0\xE2\x82\xAC", 16, {0, 0, 0});
  const int end = 20 + static_cast<int>(std::ceil(text_width(all, 16) + 40));
  std::size_t dark = 0;
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 1400; ++x)
      if (at(image, x, y).r < 128) {
        ++dark;
        EXPECT_TRUE(x > 15 && x < end && y > 15 && y < 50) << x << ' ' << y;
      }
  EXPECT_GT(dark, 3000u);
  // Each glyph but the blank leaves ink of its own shape.
  std::vector<std::vector<std::uint8_t>> seen;
  for (char c = '!'; c <= '~'; ++c) {
    Image one{24, 32, std::vector<std::uint8_t>(3 * 24 * 32, 255)};
    draw_text(one, 6, 22, std::string(1, c), 16);
    EXPECT_EQ(std::count(seen.begin(), seen.end(), one.rgb), 0) << c;
    seen.push_back(one.rgb);
  }
  Image small{4, 4, std::vector<std::uint8_t>(48, 255)};
  draw_text(small, -300, 2, all, 400);  // clipped
  draw_text(small, 1e9, -1e9, all, 12);
}

TEST(Painter, FrameBoxShowsAllOfTheBox) {
  const Box box{Vec3(-0.3, 2, 1), Vec3(0.4, 2.2, 1.9)};
  for (const Vec3& direction : {Vec3(1, 0, 0), Vec3(1, -1, 0.8), Vec3(0, 0, 1)}) {
    const Camera c = frame_box(box, direction, Vec3(0, 0.1, 1));
    const Vec3 forward = (c.target - c.eye).normalized(), right = forward.cross(c.up).normalized();
    double largest = 0;
    for (int k = 0; k < 8; ++k) {
      const Vec3 corner(k & 1 ? box.max.x() : box.min.x(), k & 2 ? box.max.y() : box.min.y(),
                        k & 4 ? box.max.z() : box.min.z());
      const Vec3 seen = corner - c.eye;
      ASSERT_GT(seen.dot(forward), 0);
      for (const Vec3& axis : {right, Vec3(right.cross(forward))})
        largest = std::max(largest, std::abs(seen.dot(axis)) / seen.dot(forward));
    }
    const double edge = std::tan(c.field_of_view * M_PI / 360);
    EXPECT_LT(largest, edge);
    EXPECT_GT(largest, 0.9 * edge);  // and no smaller than need be
  }
  EXPECT_TRUE(frame_box({}, Vec3(0, 0, 1), Vec3(0, 1, 0)).eye.allFinite());
  EXPECT_TRUE(frame_box(box, Vec3(0, 0, 1), Vec3(0, 0, 1)).eye.allFinite());
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
