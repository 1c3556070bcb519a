// The PLY 1.0 format (Turk 1994): a header that declares elements and the types of their properties, then
// their values in order, as text or binary.
#include <cmath>
#include <cstring>

#include "palpate/io/polygon.hpp"
#include "palpate/io/surface_formats.hpp"
#include "palpate/io/text_reader.hpp"

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
  std::uint64_t size = 0;
  std::vector<Property> properties;
};

struct Header {
  enum { text, little, big } order = text;
  std::vector<Element> elements;
  std::size_t end = 0, lines = 0;  // first byte after it; how many lines it has
};

Type type_of(TextReader& in, std::string_view word) {
  static constexpr std::pair<std::string_view, Type> known[] = {
      {"char", Type::i8},   {"uchar", Type::u8},   {"short", Type::i16},   {"ushort", Type::u16},
      {"int", Type::i32},   {"uint", Type::u32},   {"float", Type::f32},   {"double", Type::f64},
      {"int8", Type::i8},   {"uint8", Type::u8},   {"int16", Type::i16},   {"uint16", Type::u16},
      {"int32", Type::i32}, {"uint32", Type::u32}, {"float32", Type::f32}, {"float64", Type::f64}};
  for (const auto& [name, type] : known)
    if (word == name) return type;
  in.fail("\"{}\" is no type of PLY", printable(word));
}

Header read_header(std::string_view bytes, const std::string& name) {
  TextReader in(bytes, name);
  Header header;
  bool formatted = false;
  in.next_line();
  if (in.word() != "ply") in.fail("does not begin with \"ply\"");
  while (in.next_line()) {
    const std::string_view keyword = in.word();
    if (keyword == "end_header") {
      if (!formatted) in.fail("the header names no format");
      header.end = bytes.size() - in.left(), header.lines = in.line();
      return header;
    }
    if (keyword == "format") {
      const std::string_view w = in.word();
      formatted = true;
      if (w == "binary_little_endian")
        header.order = Header::little;
      else if (w == "binary_big_endian")
        header.order = Header::big;
      else if (w != "ascii")
        in.fail("\"{}\" is no format of PLY", printable(w));
    } else if (keyword == "element") {
      Element element;
      element.name = in.word();
      const std::int64_t size = in.integer(in.word());
      if (size < 0) in.fail("{} elements", size);
      element.size = static_cast<std::uint64_t>(size);
      header.elements.push_back(std::move(element));
    } else if (keyword == "property") {
      if (header.elements.empty()) in.fail("a property before the first element");
      Property property;
      std::string_view w = in.word();
      property.list = w == "list";
      if (property.list) property.count = type_of(in, in.word()), w = in.word();
      property.type = type_of(in, w);
      property.name = in.word();
      header.elements.back().properties.push_back(std::move(property));
    }  // anything else is a comment, announced or not
  }
  in.fail("the header has no end: truncated");
}

// The values after the header, one after the other.
class Body {
 public:
  Body(std::string_view bytes, const Header& header, const std::string& name)
      : bytes_(bytes),
        name_(name),
        order_(header.order),
        at_(header.end),
        text_(bytes.substr(header.end), name, false, header.lines) {}

  double value(Type type) {
    if (order_ == Header::text) return text_.number(next_word());
    const std::size_t n = bytes_of[static_cast<int>(type)];
    need(n);
    char raw[8] = {};
    for (std::size_t i = 0; i < n; ++i) raw[i] = bytes_[at_ + (order_ == Header::big ? n - 1 - i : i)];
    at_ += n;
    switch (type) {
      case Type::i8:
        return as<std::int8_t>(raw);
      case Type::u8:
        return as<std::uint8_t>(raw);
      case Type::i16:
        return as<std::int16_t>(raw);
      case Type::u16:
        return as<std::uint16_t>(raw);
      case Type::i32:
        return as<std::int32_t>(raw);
      case Type::u32:
        return as<std::uint32_t>(raw);
      case Type::f32:
        return static_cast<double>(as<float>(raw));
      case Type::f64:
        break;
    }
    return as<double>(raw);
  }
  std::int64_t whole(Type type, const char* what) {
    const double x = value(type);
    if (!(std::abs(x) < 4294967296.0) || x != std::floor(x)) fail("{} is {}", what, x);
    return static_cast<std::int64_t>(x);
  }
  // The length of a list, which the rest of the file can hold.
  std::size_t length(const Property& p) {
    const std::int64_t n = whole(p.count, "the length of a list");
    if (n < 0 || static_cast<std::uint64_t>(n) > left() / least(p.type)) fail("a list of {} values", n);
    return static_cast<std::size_t>(n);
  }
  void skip(const Property& p) {
    const std::size_t n = p.list ? length(p) : 1;
    if (order_ == Header::text) {  // may be "nan" there
      for (std::size_t i = 0; i < n; ++i) next_word();
    } else {
      need(n * bytes_of[static_cast<int>(p.type)]);
      at_ += n * bytes_of[static_cast<int>(p.type)];
    }
  }
  void finish() {
    if (order_ == Header::text ? !text_.word_anywhere().empty() : left() > 2)  // some end with a line end
      fail("more follows than the header announces");
  }
  // Fewest bytes an element takes.
  std::uint64_t least(const Element& e) const {
    std::uint64_t sum = 0;
    for (const Property& p : e.properties) sum += least(p.list ? p.count : p.type);
    return sum;
  }
  std::uint64_t left() const {
    return order_ == Header::text ? text_.left() + 1 : bytes_.size() - at_;  // the last line may have no end
  }
  void where(const std::string& element, std::uint64_t number) { element_ = &element, number_ = number; }

  template <class... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> text, Args&&... args) const {
    throw Error(ErrorKind::format, "{}: {} {}: {}", name_, element_ ? *element_ : "", number_,
                fmt::format(text, std::forward<Args>(args)...));
  }

 private:
  template <class T>
  static T as(const char* raw) {
    T t;
    std::memcpy(&t, raw, sizeof t);
    return t;
  }
  std::uint64_t least(Type type) const {
    return order_ == Header::text ? 2 : bytes_of[static_cast<int>(type)];
  }
  void need(std::size_t n) const {
    if (bytes_.size() - at_ < n) fail("the file ends here: truncated");
  }
  std::string_view next_word() {
    const std::string_view w = text_.word_anywhere();
    if (w.empty()) fail("the file ends here: truncated");
    return w;
  }

  std::string_view bytes_;
  const std::string& name_;
  decltype(Header::order) order_;
  std::size_t at_;
  TextReader text_;
  const std::string* element_ = nullptr;
  std::uint64_t number_ = 0;
};

// What is kept of a file: places, and corners of polygons and strips.
class Contents {
 public:
  void read(const Element& e, Body& body) {
    if (e.properties.empty()) return;  // takes no bytes, however many there are
    if (e.size > body.left() / body.least(e)) {
      body.where(e.name, 0);
      body.fail("the header announces {} of them, for which the file is too short: truncated", e.size);
    }
    if (e.size > static_cast<std::uint64_t>(std::numeric_limits<Index>::max()))
      body.fail("{} are too many", e.size);
    for (std::uint64_t i = 0; i < e.size; ++i) {
      body.where(e.name, i);
      if (e.name == "vertex")
        mesh.vertices.push_back(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
      for (const Property& p : e.properties) property(e.name, p, body);
    }
  }

  void triangulate(const std::string& name) {
    for (const Index v : corners_)
      if (v >= static_cast<Index>(mesh.vertices.size()))
        throw Error(ErrorKind::format, "{}: a face uses vertex {}, but the file has {}", name, v,
                    mesh.vertices.size());
    Triangulator triangulator;
    begins_.push_back(corners_.size());
    for (std::size_t f = 0; f + 1 < begins_.size(); ++f)
      triangulator.add({corners_.data() + begins_[f], begins_[f + 1] - begins_[f]}, mesh.vertices,
                       mesh.triangles);
  }

  TriangleMesh mesh;

 private:
  void property(const std::string& element, const Property& p, Body& body) {
    const bool indices = p.list && (p.name == "vertex_indices" || p.name == "vertex_index");
    if (element == "vertex" && !p.list && p.name.size() == 1 && p.name[0] >= 'x' && p.name[0] <= 'z')
      mesh.vertices.back()[p.name[0] - 'x'] = body.value(p.type);
    else if (element == "face" && indices)
      polygon(p, body);
    else if (element == "tristrips" && indices)
      strips(p, body);
    else
      body.skip(p);
  }
  Index index(Type type, Body& body, std::int64_t least) {
    const std::int64_t v = body.whole(type, "a vertex number");
    if (v < least || v > std::numeric_limits<Index>::max()) body.fail("vertex {} is not there", v);
    return static_cast<Index>(v);
  }
  void polygon(const Property& p, Body& body) {
    const std::size_t n = body.length(p);
    if (n < 3) body.fail("a face with {} corners", n);
    begins_.push_back(corners_.size());
    for (std::size_t i = 0; i < n; ++i) corners_.push_back(index(p.type, body, 0));
  }
  void strips(const Property& p, Body& body) {  // -1 ends a strip; every other triangle is reversed
    std::vector<Index> strip;
    for (std::size_t n = body.length(p); n > 0; --n) {
      const Index v = index(p.type, body, -1);
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

  std::vector<std::size_t> begins_;  // of each polygon in corners_
  std::vector<Index> corners_;
};

}  // namespace

TriangleMesh read_ply(std::string_view bytes, const std::string& name) {
  const Header header = read_header(bytes, name);
  for (const Element& e : header.elements)
    if (e.name == "vertex")
      for (const char* axis : {"x", "y", "z"})
        if (std::none_of(e.properties.begin(), e.properties.end(),
                         [&](const Property& p) { return p.name == axis && !p.list; }))
          throw Error(ErrorKind::format, "{}: its vertices have no property {}", name, axis);
  Body body(bytes, header, name);
  Contents contents;
  for (const Element& e : header.elements) contents.read(e, body);
  body.finish();
  contents.triangulate(name);
  return std::move(contents.mesh);
}

}  // namespace palpate
