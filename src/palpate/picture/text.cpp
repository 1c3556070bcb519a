#include "palpate/picture/text.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

// From the blank to the tilde, then the degree sign. The first character is the width, then strokes. A point
// is two characters: x as 0..9 a.. (V..Z: -5..-1), y as a letter with D on the base line, K the height of
// small letters, N of capitals. A stroke is a line through points (one point: a dot) or, after a bracket, two
// corners of an ellipse's box and the first and last angle, counter-clockwise in steps of 15 degrees as 0..9
// a...
constexpr const char* kGlyphs[] = {"3",
                                   "0 0N0G 0D",
                                   "2 0N0K 2N2K",
                                   "6 1D2N 4D5N 0G6G 0K6K",
                                   "6 (0I6N2i (0D6Ie6 3O3C",
                                   "8 (0J3N0o 7N1D (5D8H0o",
                                   "7 (1J5Nme 1K7D 5K1I (0D6I8o 6F7I",
                                   "0 0N0K",
                                   "2 (0B6O8g",
                                   "2 (WB2Ok4",
                                   "4 2N2H 0M4I 4M0I",
                                   "6 3E3K 0H6H",
                                   "1 1E0B",
                                   "4 0H4H",
                                   "0 0D",
                                   "4 0C4N",
                                   "6 (0D6N0o",
                                   "6 1L3N3D 1D5D",
                                   "6 (0H6Nlb 5I0D6D",
                                   "6 (0I6Nia (0D6Ie6",
                                   "6 4D4N0G6G",
                                   "6 5N1N1I (0D6Je9",
                                   "6 (0D6J0o (0@cN7c",
                                   "6 0N6N2D",
                                   "6 (1I5N0o (0D6I0o",
                                   "6 (0H6N0o (UD6Rjo",
                                   "0 0J 0D",
                                   "1 1J 1E0B",
                                   "5 5K0H5E",
                                   "6 0J6J 0F6F",
                                   "5 0K5H0E",
                                   "4 (0I4Nib 2I2G 2D",
                                   "9 (0C9M0k (3F6J0o 6J6G (6F9Ico 9H9G",
                                   "6 0D3N6D 1G5G",
                                   "6 3I0I 3D0D0N3N (1I5Ni6 (0D6Ii6",
                                   "6 (0D7N3l",
                                   "7 3D0D0N3N (ZD7Ni6",
                                   "5 5D0D0N5N 0I4I",
                                   "5 0D0N5N 0I4I",
                                   "7 (0D7N3o 4I7I",
                                   "6 0D0N 6D6N 0I6I",
                                   "0 0D0N",
                                   "4 4N4G (0D4Jdo",
                                   "6 0D0N 6N0G 2I6D",
                                   "5 0N0D5D",
                                   "8 0D0N4F8N8D",
                                   "6 0D0N6D6N",
                                   "8 (0D8N0o",
                                   "6 0D0N3N (0H6Ni6 3H0H",
                                   "8 (0D8N0o 5G8C",
                                   "6 0D0N3N (0H6Ni6 3H0H 3H6D",
                                   "6 (0I6N2i (0D6Ie6",
                                   "6 0N6N 3D3N",
                                   "6 0N0G 6N6G (0D6Jco",
                                   "6 0N3D6N",
                                   "8 0N2D4N6D8N",
                                   "6 0D6N 0N6D",
                                   "6 0N3I6N 3I3D",
                                   "6 0N6N0D6D",
                                   "2 2B0B0O2O",
                                   "4 0N4C",
                                   "2 0B2B2O0O",
                                   "4 0K2N4K",
                                   "6 0B6B",
                                   "2 0N2L",
                                   "5 (0D5K0o 5K5D",
                                   "5 0N0D (0D5K0o",
                                   "4 (0D5K3l",
                                   "5 (0D5K0o 5N5D",
                                   "5 (0D5K0l 0H5H",
                                   "3 1D1L (1J5N6c 0K3K",
                                   "5 (0D5K0o 5K5C (0A5Fdo",
                                   "5 0N0D (0F5K0c 5I5D",
                                   "0 0K0D 0N",
                                   "2 2K2C (YA2Eho 2N",
                                   "5 0N0D 5K0G 2I5D",
                                   "2 0N0F (0D4Hci",
                                   "8 0K0D (0F4K0c (4F8K0c 4I4D 8I8D",
                                   "5 0K0D (0F5K0c 5I5D",
                                   "5 (0D5K0o",
                                   "5 0K0A (0D5K0o",
                                   "5 (0D5K0o 5K5A",
                                   "3 0K0D (0F5K4c",
                                   "4 (0H4K2i (0D4He6",
                                   "3 1M1F (1D5Hci 0K3K",
                                   "5 0K0F (0D5Ico 5K5D",
                                   "4 0K2D4K",
                                   "8 0K2D4K6D8K",
                                   "4 0D4K 0K4D",
                                   "4 0K2D 4K1A",
                                   "4 0K4K0D4D",
                                   "3 3O2N2K0I2G2C3B",
                                   "0 0B0O",
                                   "3 0O1N1K3I1G1C0B",
                                   "6 0H2J4H6J",
                                   "3 (0K3N0o"};

constexpr double kCapital = 10, kSpacing = 2.6, kPen = 0.62;  // glyph units; kPen: radius

using Point = Eigen::Vector2d;
using Stroke = std::vector<Point>;

int digit(char c) { return c <= '9' ? c - '0' : c - 'a' + 10; }
double abscissa(char c) { return c >= 'A' && c <= 'Z' ? c - 'Z' - 1 : digit(c); }
double ordinate(char c) { return c - 'D'; }

Stroke parse_stroke(std::string_view text) {
  Stroke stroke;
  if (text[0] != '(') {
    for (std::size_t i = 0; i + 1 < text.size(); i += 2)
      stroke.emplace_back(abscissa(text[i]), ordinate(text[i + 1]));
    return stroke;
  }
  const Point low(abscissa(text[1]), ordinate(text[2])), high(abscissa(text[3]), ordinate(text[4]));
  const int first = digit(text[5]), last = digit(text[6]) + (digit(text[6]) <= first ? 24 : 0);
  for (int i = 2 * first; i <= 2 * last; ++i) {
    const double angle = i * M_PI / 24;
    stroke.push_back(0.5 * (low + high) +
                     0.5 * (high - low).cwiseProduct(Point(std::cos(angle), std::sin(angle))));
  }
  return stroke;
}

// Strokes of a line of text in glyph units, the base line at 0; returns the width.
double lay_out(std::string_view text, std::vector<Stroke>* strokes) {
  double x = 0;
  bool any = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const unsigned char c = static_cast<unsigned char>(text[i]);
    if (c >= 0x80 && c < 0xC0) continue;  // the rest of a character of several bytes
    const bool degree = c == 0xC2 && i + 1 < text.size() && static_cast<unsigned char>(text[i + 1]) == 0xB0;
    const std::string_view glyph = kGlyphs[degree ? 95 : c >= ' ' && c <= '~' ? c - ' ' : '?' - ' '];
    if (any) x += kSpacing;
    any = true;
    for (std::size_t at = 2; strokes && at < glyph.size();) {
      const std::size_t end = std::min(glyph.find(' ', at), glyph.size());
      strokes->push_back(parse_stroke(glyph.substr(at, end - at)));
      for (Point& p : strokes->back()) p[0] += x;
      at = end + 1;
    }
    x += digit(glyph[0]);
  }
  return x;
}

double distance(const Point& p, const Point& a, const Point& b) {
  const Point ab = b - a;
  const double length2 = ab.squaredNorm();
  const double t = length2 > 0 ? std::clamp(ab.dot(p - a) / length2, 0.0, 1.0) : 0;
  return (p - a - t * ab).norm();
}

}  // namespace

double text_width(std::string_view text, double cap_height) {
  return lay_out(text, nullptr) * cap_height / kCapital;
}

void draw_text(Image& image, double x, double y, std::string_view text, double cap_height,
               const std::array<std::uint8_t, 3>& color) {
  const double unit = cap_height / kCapital, pen = std::max(kPen * unit, 0.55);
  std::vector<Stroke> strokes;
  const double width = lay_out(text, &strokes) * unit;
  const auto clamped = [](double v, int limit) {
    return static_cast<int>(std::clamp(v, 0.0, double(limit)));
  };
  const int x0 = clamped(std::floor(x - 6 * unit), image.width),
            x1 = clamped(std::ceil(x + width + 2 * unit), image.width);
  const int y0 = clamped(std::floor(y - 1.3 * cap_height), image.height);
  const int y1 = clamped(std::ceil(y + 0.5 * cap_height), image.height);
  if (x1 <= x0 || y1 <= y0) return;
  std::vector<float> ink(static_cast<std::size_t>(x1 - x0) * static_cast<std::size_t>(y1 - y0), 0.0f);
  for (const Stroke& stroke : strokes)
    for (std::size_t i = 0; i < stroke.size(); ++i) {
      const auto pixel = [&](const Point& p) { return Point(x + unit * p[0], y - unit * p[1]); };
      const Point a = pixel(stroke[i]), b = pixel(stroke[std::min(i + 1, stroke.size() - 1)]);
      const Point low = a.cwiseMin(b).array() - pen - 1, high = a.cwiseMax(b).array() + pen + 1;
      for (int py = std::max(y0, static_cast<int>(low[1])); py < std::min<double>(y1, high[1]); ++py)
        for (int px = std::max(x0, static_cast<int>(low[0])); px < std::min<double>(x1, high[0]); ++px) {
          const double cover = pen + 0.5 - distance(Point(px + 0.5, py + 0.5), a, b);
          float& drop = ink[static_cast<std::size_t>(py - y0) * (x1 - x0) + (px - x0)];
          drop = std::max(drop, static_cast<float>(std::clamp(cover, 0.0, 1.0)));
        }
    }
  for (int py = y0; py < y1; ++py)
    for (int px = x0; px < x1; ++px) {
      const float drop = ink[static_cast<std::size_t>(py - y0) * (x1 - x0) + (px - x0)];
      std::uint8_t* rgb = &image.rgb[3 * (static_cast<std::size_t>(py) * image.width + px)];
      for (int k = 0; k < 3; ++k)
        rgb[k] = static_cast<std::uint8_t>(std::lround(rgb[k] + drop * (float(color[k]) - float(rgb[k]))));
    }
}

}  // namespace palpate
