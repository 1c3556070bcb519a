// Colours for values: pale flesh through rose and violet to deep blue. Laid out in Oklab (Ottosson 2020, "A
// perceptual color space for image processing"), where equal distances look equally different, and walked at
// constant speed; lightness falls all the way, so the scale survives printing in grey and most colour
// blindness.
#include <algorithm>
#include <cmath>

#include "palpate/picture/picture.hpp"

namespace palpate {
namespace {

constexpr int kSteps = 256;
using Table = std::array<Vec3, kSteps>;

Vec3 oklab_to_linear(const Vec3& lab) {
  const double l = lab[0] + 0.3963377774 * lab[1] + 0.2158037573 * lab[2];
  const double m = lab[0] - 0.1055613458 * lab[1] - 0.0638541728 * lab[2];
  const double s = lab[0] - 0.0894841775 * lab[1] - 1.2914855480 * lab[2];
  const Vec3 cubes(l * l * l, m * m * m, s * s * s);
  Mat3 to_rgb;
  to_rgb << 4.0767416621, -3.3077115913, 0.2309699292, -1.2684380046, 2.6097574011, -0.3413193965,
      -0.0041960863, -0.7034186147, 1.7076147010;
  return to_rgb * cubes;
}

double encode(double linear) {
  const double c = std::clamp(linear, 0.0, 1.0);
  return c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1 / 2.4) - 0.055;
}

// Catmull-Rom through the stops, in Oklab: lightness, chroma, hue (degrees).
Vec3 curve(double t) {
  constexpr int kStops = 7;
  static const double stops[kStops][3] = {{0.86, 0.050, 58}, {0.77, 0.095, 46},  {0.68, 0.140, 28},
                                          {0.58, 0.175, 5},  {0.49, 0.180, -25}, {0.40, 0.165, -55},
                                          {0.31, 0.130, -80}};
  const auto lab = [](int i) {
    const double* stop = stops[std::clamp(i, 0, kStops - 1)];
    const double hue = stop[2] * M_PI / 180;
    return Vec3(stop[0], stop[1] * std::cos(hue), stop[1] * std::sin(hue));
  };
  const double x = t * (kStops - 1);
  const int i = std::min(static_cast<int>(x), kStops - 2);
  const double f = x - i;
  const Vec3 a = i ? lab(i - 1) : Vec3(2 * lab(0) - lab(1)), b = lab(i), c = lab(i + 1);
  const Vec3 d = i + 2 < kStops ? lab(i + 2) : Vec3(2 * c - b);
  return b + 0.5 * f * ((c - a) + f * ((2 * a - 5 * b + 4 * c - d) + f * (3 * (b - c) + d - a)));
}

Table make_table() {
  constexpr int kFine = 4096;
  std::vector<double> length(kFine + 1, 0.0);
  for (int i = 1; i <= kFine; ++i)
    length[i] = length[i - 1] + (curve(double(i) / kFine) - curve(double(i - 1) / kFine)).norm();
  Table table;
  for (int i = 0; i < kSteps; ++i) {
    const double wanted = length.back() * i / (kSteps - 1);
    const auto at = std::lower_bound(length.begin(), length.end(), wanted);
    table[i] = oklab_to_linear(curve(double(at - length.begin()) / kFine)).unaryExpr(&encode);
  }
  return table;
}

}  // namespace

std::array<std::uint8_t, 3> color_scale(double fraction) {
  static const Table table = make_table();
  const double x = (fraction >= 0 ? std::min(fraction, 1.0) : 0.0) * (kSteps - 1);  // NaN: the low end
  const Vec3& c = table[static_cast<std::size_t>(std::lround(x))];
  const auto byte = [](double v) { return static_cast<std::uint8_t>(std::lround(255 * v)); };
  return {byte(c[0]), byte(c[1]), byte(c[2])};
}

}  // namespace palpate
