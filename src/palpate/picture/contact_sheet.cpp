#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "palpate/picture/picture.hpp"
#include "palpate/picture/text.hpp"

namespace palpate {
namespace {

constexpr int kMargin = 28, kGap = 14, kTitle = 20, kCaption = 13, kBarHeight = 16;
constexpr std::uint8_t kPaper = 255;

Image blank(int width, int height) {
  Image image{width, height, {}};
  image.rgb.assign(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height), kPaper);
  return image;
}

void paste(Image& sheet, const Image& tile, int x, int y) {
  for (int row = 0; row < tile.height; ++row)
    std::copy_n(tile.rgb.begin() + 3 * static_cast<std::ptrdiff_t>(row) * tile.width, 3 * tile.width,
                sheet.rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(y + row) * sheet.width + x));
}

void fill(Image& image, int x0, int y0, int x1, int y1, const std::array<std::uint8_t, 3>& color) {
  for (int y = std::max(y0, 0); y < std::min(y1, image.height); ++y)
    for (int x = std::max(x0, 0); x < std::min(x1, image.width); ++x)
      std::copy(color.begin(), color.end(),
                image.rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(y) * image.width + x));
}

// Smaller where it would not fit.
double fitting(std::string_view text, double cap_height, double width) {
  const double needed = text_width(text, cap_height);
  return needed > width ? cap_height * width / needed : cap_height;
}

// 1, 2 or 5 times a power of ten, so that there are four to eight steps.
double tick_step(double span) {
  const double power = std::pow(10, std::floor(std::log10(span / 4)));
  for (const double factor : {5.0, 2.0})
    if (span / (factor * power) >= 4) return factor * power;
  return power;
}

void draw_legend(Image& sheet, int x0, int x1, int y, const std::string& legend, double low, double high) {
  const std::array<std::uint8_t, 3> ink{40, 44, 52};
  for (int x = x0; x < x1; ++x)
    fill(sheet, x, y, x + 1, y + kBarHeight, color_scale((x - x0) / std::max(x1 - x0 - 1.0, 1.0)));
  draw_text(sheet, x0 - 14 - text_width(legend, kCaption), y + 0.5 * (kBarHeight + kCaption), legend,
            kCaption);
  const double span = high - low;
  if (!(span > 0) || !std::isfinite(span)) return;
  const double step = tick_step(span);
  const int decimals = std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9)));
  for (double i = std::ceil(low / step - 1e-9); i * step <= high + 1e-9 * span; ++i) {
    const int x = x0 + static_cast<int>(std::lround((i * step - low) / span * (x1 - x0 - 1)));
    fill(sheet, x, y + kBarHeight, x + 1, y + kBarHeight + 5, ink);
    const std::string label = decimals > 5 || step >= 1e6 ? fmt::format("{:g}", i * step)
                                                          : fmt::format("{:.{}f}", i * step + 0.0, decimals);
    draw_text(sheet, x - 0.5 * text_width(label, kCaption - 2), y + kBarHeight + 20, label, kCaption - 2);
  }
}

}  // namespace

Image contact_sheet(const std::vector<Tile>& tiles, int columns, const std::string& title,
                    const std::string& legend, double value_min, double value_max) {
  int cell_width = 320, cell_height = 0;
  for (const Tile& tile : tiles) {
    cell_width = std::max(cell_width, tile.image.width);
    cell_height = std::max(cell_height, tile.image.height);
  }
  const int count = static_cast<int>(tiles.size());
  columns = std::clamp(columns, 1, std::max(count, 1));
  const int rows = (count + columns - 1) / columns;
  const int caption_height = 2 * kCaption + 6, head = title.empty() ? kMargin : 2 * kMargin + kTitle;
  const int width = 2 * kMargin + columns * cell_width + (columns - 1) * kGap;
  const int legend_y = head + rows * (cell_height + caption_height + kGap);
  Image sheet = blank(width, legend_y + kBarHeight + 24 + kMargin);
  const double inner = width - 2 * kMargin;
  draw_text(sheet, kMargin, kMargin + kTitle, title, fitting(title, kTitle, inner));
  for (int i = 0; i < count; ++i) {
    const Tile& tile = tiles[i];
    const int x = kMargin + i % columns * (cell_width + kGap),
              y = head + i / columns * (cell_height + caption_height + kGap);
    paste(sheet, tile.image, x + (cell_width - tile.image.width) / 2, y);
    draw_text(sheet, x, y + cell_height + kCaption + 8, tile.caption,
              fitting(tile.caption, kCaption, cell_width));
  }
  const int bar = std::min(560, static_cast<int>(0.55 * inner)), x0 = (width - bar) / 2;
  const double room = x0 - 14 - kMargin, wanted = text_width(legend, kCaption);
  const int shift = static_cast<int>(std::max(0.0, wanted - room));
  draw_legend(sheet, std::min(x0 + shift, width - kMargin - bar),
              std::min(x0 + shift, width - kMargin - bar) + bar, legend_y, legend, value_min, value_max);
  return sheet;
}

}  // namespace palpate
