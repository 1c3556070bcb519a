// The PLY 1.0 format (Turk 1994): a header that declares elements and the types of their properties, then
// their values in order, as text or binary.
#include <algorithm>
#include <cmath>

#include "palpate/io/polygon.hpp"
#include "palpate/io/scanner.hpp"
#include "palpate/io/surface_formats.hpp"

namespace palpate {

namespace {

enum class Type { i8, u8, i16, u16, i32, u32, f32, f64 };
constexpr std::size_t bytes_of[] = {1, 1, 2, 2, 4, 4, 4, 8};

struct Property {
  std::string name;
  Type type = Type::f32, count = Type::u8;  // count: of a list
  bool list = false;
};

struct Element {
  std::string name;
  std::int64_t size = 0;
  std::vector<Property> properties;
};

std::string_view word_on_line(Scanner& in) { return in.line_ends() ? std::string_view() : in.word(); }

Type read_type(Scanner& in) {
  static constexpr std::pair<std::string_view, Type> known[] = {
      {"char", Type::i8},   {"uchar", Type::u8},   {"short", Type::i16},   {"ushort", Type::u16},
      {"int", Type::i32},   {"uint", Type::u32},   {"float", Type::f32},   {"double", Type::f64},
      {"int8", Type::i8},   {"uint8", Type::u8},   {"int16", Type::i16},   {"uint16", Type::u16},
      {"int32", Type::i32}, {"uint32", Type::u32}, {"float32", Type::f32}, {"float64", Type::f64}};
  const std::string_view word = word_on_line(in);
  for (const auto& [name, type] : known)
    if (word == name) return type;
  in.fail(shown(word) + " is no type of PLY");
}

void read_format(Scanner& in) {
  const std::string_view w = word_on_line(in);
  in.binary = w != "ascii";
  in.swapped = w == "binary_big_endian";
  if (in.binary && !in.swapped && w != "binary_little_endian") in.fail(shown(w) + " is no format of PLY");
}

Property read_property(Scanner& in) {
  Property property;
  in.line_ends();
  if (in.peek_word() == "list") {
    in.word();
    property.list = true;
    property.count = read_type(in);
  }
  property.type = read_type(in);
  property.name = word_on_line(in);
  return property;
}

// Leaves `in` at the first value.
std::vector<Element> read_header(Scanner& in) {
  if (in.line() != "ply") in.fail("does not begin with \"ply\"");
  std::vector<Element> elements;
  bool binary = false, swapped = false, formatted = false;
  for (;; in.line()) {
    const std::string_view keyword = in.word();
    if (keyword == "end_header") break;
    if (keyword == "format") {
      read_format(in);
      formatted = true;
      binary = std::exchange(in.binary, false), swapped = in.swapped;  // the header is text
    } else if (keyword == "element") {
      const std::string name(word_on_line(in));
      elements.push_back({name, in.line_ends() ? -1 : in.integer(), {}});
      if (elements.back().size < 0) in.fail("an element without its number");
    } else if (keyword == "property") {
      if (elements.empty()) in.fail("a property before the first element");
      elements.back().properties.push_back(read_property(in));
    }  // anything else is a comment, announced or not
  }
  in.line();
  if (!formatted) in.fail("the header names no format");
  in.binary = binary, in.swapped = swapped;
  return elements;
}

double read_value(Scanner& in, Type type) {
  if (!in.binary) return in.number();
  switch (type) {
    case Type::i8:
      return in.raw<std::int8_t>();
    case Type::u8:
      return in.raw<std::uint8_t>();
    case Type::i16:
      return in.raw<std::int16_t>();
    case Type::u16:
      return in.raw<std::uint16_t>();
    case Type::i32:
      return in.raw<std::int32_t>();
    case Type::u32:
      return in.raw<std::uint32_t>();
    case Type::f32:
      return static_cast<double>(in.raw<float>());
    case Type::f64:
      break;
  }
  return in.raw<double>();
}

std::int64_t read_whole(Scanner& in, Type type) {
  const double x = read_value(in, type);
  if (!(std::abs(x) < 4294967296.0) || x != std::floor(x)) in.fail(fmt::format("{} is no whole number", x));
  return static_cast<std::int64_t>(x);
}

// Fewest bytes a value takes: in text, a digit and a blank, but for the last of the file.
std::size_t least(const Scanner& in, Type type) { return in.binary ? bytes_of[static_cast<int>(type)] : 1; }

std::size_t read_length(Scanner& in, const Property& p) {
  return in.count(read_whole(in, p.count), least(in, p.type));
}

void skip(Scanner& in, const Property& p) {
  const std::size_t n = p.list ? read_length(in, p) : 1;
  if (in.binary)
    in.take(n * bytes_of[static_cast<int>(p.type)]);
  else
    for (std::size_t i = 0; i < n; ++i) in.word();  // may be "nan"
}

// What is kept of a file: places, and corners of polygons and strips.
class Contents {
 public:
  explicit Contents(Scanner& in) : in_(in) {}

  void read(const Element& e) {
    if (e.properties.empty()) return;  // takes no bytes, however many there are
    std::size_t bytes = 0;
    for (const Property& p : e.properties) bytes += least(in_, p.list ? p.count : p.type);
    in_.at(e.name.c_str());
    in_.count(e.size, bytes);
    if (e.size > std::numeric_limits<Index>::max()) in_.fail(fmt::format("{} are too many", e.size));
    for (std::int64_t i = 0; i < e.size; ++i) {
      in_.at(e.name.c_str(), i);
      if (e.name == "vertex") mesh.vertices.push_back(Vec3::Zero());
      for (const Property& p : e.properties) property(e.name, p);
    }
  }

  void triangulate() {
    in_.at(nullptr);
    for (const Index v : corners_)
      if (static_cast<std::size_t>(v) >= mesh.vertices.size())
        in_.fail(fmt::format("a face uses vertex {}, but the file has {}", v, mesh.vertices.size()));
    Triangulator triangulator;
    begins_.push_back(corners_.size());
    for (std::size_t f = 0; f + 1 < begins_.size(); ++f)
      triangulator.add({corners_.data() + begins_[f], begins_[f + 1] - begins_[f]}, mesh.vertices,
                       mesh.triangles);
  }

  TriangleMesh mesh;

 private:
  void property(const std::string& element, const Property& p) {
    const bool indices = p.list && (p.name == "vertex_indices" || p.name == "vertex_index");
    if (element == "vertex" && !p.list && p.name.size() == 1 && p.name[0] >= 'x' && p.name[0] <= 'z')
      mesh.vertices.back()[p.name[0] - 'x'] = read_value(in_, p.type);
    else if (element == "face" && indices)
      polygon(p);
    else if (element == "tristrips" && indices)
      strips(p);
    else
      skip(in_, p);
  }
  Index index(Type type, std::int64_t smallest) {
    const std::int64_t v = read_whole(in_, type);
    if (v < smallest || v > std::numeric_limits<Index>::max())
      in_.fail(fmt::format("there is no vertex {}", v));
    return static_cast<Index>(v);
  }
  void polygon(const Property& p) {
    const std::size_t n = read_length(in_, p);
    if (n < 3) in_.fail(fmt::format("{} corners", n));
    begins_.push_back(corners_.size());
    for (std::size_t i = 0; i < n; ++i) corners_.push_back(index(p.type, 0));
  }
  void strips(const Property& p) {  // -1 ends a strip; every other triangle is reversed
    std::vector<Index> strip;
    for (std::size_t n = read_length(in_, p); n > 0; --n) {
      const Index v = index(p.type, -1);
      if (v < 0) {
        strip.clear();
        continue;
      }
      strip.push_back(v);
      if (strip.size() < 3) continue;
      const Index* c = strip.data() + strip.size() - 3;
      const int odd = strip.size() % 2 == 0;
      begins_.push_back(corners_.size());
      corners_.insert(corners_.end(), {c[odd], c[1 - odd], c[2]});
    }
  }

  Scanner& in_;
  std::vector<std::size_t> begins_;  // of each polygon in corners_
  std::vector<Index> corners_;
};

}  // namespace

TriangleMesh read_ply(std::string_view bytes, const std::string& name) {
  Scanner in(name, bytes);
  const std::vector<Element> elements = read_header(in);
  for (const Element& e : elements)
    if (e.name == "vertex")
      for (const char* axis : {"x", "y", "z"})
        if (std::none_of(e.properties.begin(), e.properties.end(),
                         [&](const Property& p) { return p.name == axis && !p.list; }))
          in.fail(fmt::format("the vertices have no property {}", axis));
  Contents contents(in);
  for (const Element& e : elements) contents.read(e);
  in.at(nullptr);
  if (in.binary ? in.left() > 2 : !in.at_end())  // some end with a line's end
    in.fail("more follows than the header announces");
  if (!in.binary) in.require_line_end();
  contents.triangulate();
  return std::move(contents.mesh);
}

}  // namespace palpate
