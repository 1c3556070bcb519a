// Captions: a small alphabet of strokes, drawn with a round pen at any size.
#pragma once

#include <array>
#include <string_view>

#include "palpate/picture/picture.hpp"

namespace palpate {

// Pixels. ASCII and the degree sign; anything else is drawn as a question mark.
double text_width(std::string_view text, double cap_height);
// `x` is the left end, `y` the base line, from the top left corner of the picture; clipped at its edges.
void draw_text(Image& image, double x, double y, std::string_view text, double cap_height,
               const std::array<std::uint8_t, 3>& color = {40, 44, 52});

}  // namespace palpate
