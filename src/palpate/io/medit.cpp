// MEDIT's .mesh (text) and .meshb (binary, the Gamma mesh format). Frey, "MEDIT: an interactive mesh
// visualization software", 2001; Marechal, "Handling unstructured meshes with libMeshb".
#include <algorithm>
#include <cctype>

#include "palpate/io/tet_formats.hpp"

namespace palpate {

namespace {

struct CellKind {
  const char* keyword;
  int code;  // in binary files
  int nodes;
  bool tetrahedron;
};

constexpr CellKind cell_kinds[] = {{"Edges", 5, 2, false},          {"Triangles", 6, 3, false},
                                   {"Quadrilaterals", 7, 4, false}, {"Tetrahedra", 8, 4, true},
                                   {"Prisms", 9, 6, false},         {"Hexahedra", 10, 8, false},
                                   {"Pyramids", 49, 5, false},      {"EdgesP2", 25, 3, false},
                                   {"TrianglesP2", 24, 6, false},   {"TetrahedraP2", 30, 10, true}};

template <class Integer>
void read_cells(Scanner& in, RawTets& raw, const CellKind& kind, std::size_t n, Integer&& integer) {
  if (!kind.tetrahedron) {
    raw.other_cells += n;
    return;
  }
  for (std::size_t i = 0; i < n; ++i) {
    in.at("tetrahedron", static_cast<std::int64_t>(i + 1));
    std::array<std::int64_t, 4> t;
    for (std::int64_t& v : t) v = integer();
    for (int k = 4; k < kind.nodes; ++k) integer();
    raw.tets.push_back(t);
    raw.tags.push_back(static_cast<double>(integer()));
  }
  if (kind.nodes > 4) raw.higher_order += n;
}

template <class Real, class Integer>
void read_vertices(Scanner& in, RawTets& raw, std::size_t n, Real&& real, Integer&& integer) {
  raw.nodes.reserve(raw.nodes.size() + n);
  for (std::size_t i = 0; i < n; ++i) {
    in.at("vertex", static_cast<std::int64_t>(i + 1));
    const double x = real(), y = real(), z = real();
    raw.nodes.push_back({x, y, z});
    integer();
  }
}

void require_3d(const Scanner& in, std::int64_t dimension) {
  if (dimension != 3) in.fail(fmt::format("has {} dimensions, not 3", dimension));
}

}  // namespace

RawTets read_medit(Scanner& in) {
  RawTets raw;
  raw.format = "MEDIT text";
  raw.first_number = 1;
  const auto real = [&] { return in.number(); };
  const auto integer = [&] { return in.integer(); };
  bool ended = false;
  while (!ended && !in.at_end()) {
    in.at(nullptr);
    const std::string keyword(in.word());
    if (!std::isalpha(static_cast<unsigned char>(keyword[0])))
      in.fail("expected a keyword such as Vertices, found " + shown(keyword));
    ended = keyword == "End";
    bool skip = !ended;
    if (keyword == "Dimension") require_3d(in, in.integer()), skip = false;
    if (keyword == "Vertices") read_vertices(in, raw, in.count(in.integer(), 8), real, integer), skip = false;
    for (const CellKind& kind : cell_kinds)
      if (keyword == kind.keyword)
        read_cells(in, raw, kind, in.count(in.integer(), 2 * static_cast<std::size_t>(kind.nodes) + 1),
                   integer),
            skip = !kind.tetrahedron;
    // What belongs to other keywords are numbers.
    while (skip && !in.at_end() && !std::isalpha(static_cast<unsigned char>(in.peek_word()[0]))) in.word();
  }
  in.at(nullptr);
  if (!ended) in.require_line_end();  // not every program writes End
  return raw;
}

RawTets read_medit_binary(Scanner& in) {
  RawTets raw;
  raw.format = "MEDIT binary";
  raw.first_number = 1;
  in.binary = true;
  in.swapped = in.raw<std::int32_t>() != 1;
  const auto version = in.raw<std::int32_t>();
  if (version < 1 || version > 4) in.fail(fmt::format("MEDIT binary version {} is not known", version));
  const auto integer = [&] {
    return version < 4 ? std::int64_t{in.raw<std::int32_t>()} : in.raw<std::int64_t>();
  };
  const auto real = [&] { return version < 2 ? double{in.raw<float>()} : in.raw<double>(); };
  const std::size_t wide = version < 4 ? 4 : 8;
  for (;;) {
    in.at(nullptr);
    const auto code = in.raw<std::int32_t>();
    if (code == 54) return raw;  // End
    const std::int64_t next = version < 3 ? std::int64_t{in.raw<std::int32_t>()} : in.raw<std::int64_t>();
    if (next <= static_cast<std::int64_t>(in.position())) in.fail("a section's end lies before it");
    if (code == 3) require_3d(in, in.raw<std::int32_t>());
    if (code == 4)
      read_vertices(in, raw, in.count(integer(), 3 * (version < 2 ? 4 : 8) + wide), real, integer);
    for (const CellKind& kind : cell_kinds)
      if (code == kind.code)
        read_cells(in, raw, kind, in.count(integer(), (static_cast<std::size_t>(kind.nodes) + 1) * wide),
                   integer);
    in.move_to(static_cast<std::uint64_t>(next));
  }
}

}  // namespace palpate
