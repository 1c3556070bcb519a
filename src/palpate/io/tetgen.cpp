// TetGen's .node and .ele. Hang Si, "TetGen user's manual", section 5.
#include "palpate/io/tet_formats.hpp"

namespace palpate {

RawTets read_tetgen(Scanner& nodes, Scanner& elements) {
  RawTets raw;
  raw.format = "TetGen";
  nodes.at("header");
  const std::int64_t announced = nodes.integer(), dimension = nodes.integer();
  const std::size_t n = nodes.count(announced, 8);
  if (dimension != 3) nodes.fail(fmt::format("has {} dimensions, not 3", dimension));
  const std::size_t more = nodes.count(nodes.integer(), 1), markers = nodes.count(nodes.integer(), 1);
  raw.nodes.reserve(n);
  for (std::size_t i = 0; i < n; ++i) {
    nodes.at("node", static_cast<std::int64_t>(i));
    const std::int64_t number = nodes.integer();
    if (i == 0) raw.first_number = number;
    if (number - static_cast<std::int64_t>(i) != raw.first_number)
      nodes.fail(
          fmt::format("is numbered {}, not {}", number, raw.first_number + static_cast<std::int64_t>(i)));
    const double x = nodes.number(), y = nodes.number(), z = nodes.number();
    raw.nodes.push_back({x, y, z});
    for (std::size_t k = 0; k < more + markers; ++k) nodes.number();
  }
  nodes.at(nullptr);
  if (!nodes.at_end()) nodes.fail("holds more than was announced");
  nodes.require_line_end();

  elements.at("header");
  const std::size_t tets = elements.count(elements.integer(), 8);
  const std::int64_t corners = elements.integer();
  if (corners != 4 && corners != 10)
    elements.fail(fmt::format("has {} nodes a tetrahedron, not 4 or 10", corners));
  const std::size_t attributes = elements.count(elements.integer(), 1);
  for (std::size_t i = 0; i < tets; ++i) {
    elements.at("tetrahedron", static_cast<std::int64_t>(i));
    elements.integer();
    std::array<std::int64_t, 4> t;
    for (std::int64_t& v : t) v = elements.integer();
    for (std::int64_t k = 4; k < corners; ++k) elements.integer();
    raw.tets.push_back(t);
    for (std::size_t k = 0; k < attributes; ++k) {
      const double value = elements.number();
      if (k == 0) raw.tags.push_back(value);
    }
  }
  if (corners == 10) raw.higher_order = tets;
  elements.at(nullptr);
  if (!elements.at_end()) elements.fail("holds more than was announced");
  elements.require_line_end();
  return raw;
}

}  // namespace palpate
