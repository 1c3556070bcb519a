// VTK's XML unstructured grids (.vtu): text, base64 with and without zlib, inline and appended, appended raw;
// headers of 32 and 64 bits; both byte orders. "VTK XML formats", VTK documentation.
#include <zlib.h>

#include <pugixml.hpp>

#include "palpate/io/tet_formats.hpp"

namespace palpate {

namespace {

NumberType number_type(std::string_view name) {
  static const std::map<std::string_view, NumberType> types{
      {"Int8", {1, 's'}},    {"UInt8", {1, 'u'}},  {"Int16", {2, 's'}}, {"UInt16", {2, 'u'}},
      {"Int32", {4, 's'}},   {"UInt32", {4, 'u'}}, {"Int64", {8, 's'}}, {"UInt64", {8, 'u'}},
      {"Float32", {4, 'f'}}, {"Float64", {8, 'f'}}};
  const auto found = types.find(name);
  return found == types.end() ? NumberType{0, 0} : found->second;
}

// Bytes out of base64 text. A header may be encoded apart from its data: its padding ends a group of four.
class Base64Reader {
 public:
  Base64Reader(const Scanner& in, std::string_view text) : in_(in), text_(text) {}
  std::string take(std::uint64_t size) {
    if (size > kept_.size() && (size - kept_.size()) / 3 > (text_.size() - at_) / 4)
      in_.fail("base64 data ends early");
    while (kept_.size() < size) group();
    const std::string out = kept_.substr(0, static_cast<std::size_t>(size));
    kept_.erase(0, static_cast<std::size_t>(size));
    return out;
  }

 private:
  void group() {
    std::uint32_t bits = 0;
    int digits = 0, padding = 0;
    while (digits < 4) {
      if (at_ >= text_.size()) in_.fail("base64 data ends early");
      const char c = text_[at_++];
      if (c == ' ' || (c >= '\t' && c <= '\r')) continue;
      const int value = digit(c);
      if (value < 0 ? c != '=' || digits < 2 : padding > 0) in_.fail("base64 data holds " + shown({&c, 1}));
      padding += value < 0;
      bits = bits << 6 | static_cast<std::uint32_t>(value < 0 ? 0 : value);
      ++digits;
    }
    for (int i = 0; i < 3 - padding; ++i) kept_ += static_cast<char>(bits >> (16 - 8 * i) & 0xff);
  }
  static int digit(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
  }
  const Scanner& in_;
  std::string_view text_;
  std::size_t at_ = 0;
  std::string kept_;
};

class VtuReader {
 public:
  VtuReader(const std::string& file, const std::string& bytes)
      : file_(file), bytes_(bytes), in_(file, bytes) {}

  RawTets read() {
    parse();
    const pugi::xml_node root = document_.child("VTKFile");
    if (std::string_view(root.attribute("type").value()) != "UnstructuredGrid")
      in_.fail("is no VTKFile of type UnstructuredGrid");
    const std::string_view order = root.attribute("byte_order").value();
    in_.swapped = order == "BigEndian";
    const std::string_view header = root.attribute("header_type").value();
    header_ = header.empty() ? NumberType{4, 'u'} : number_type(header);
    if (header_.kind != 'u' || header_.size < 4) in_.fail("unknown header_type " + shown(header));
    const std::string_view compressor = root.attribute("compressor").value();
    compressed_ = !compressor.empty();
    if (compressed_ && compressor != "vtkZLibDataCompressor")
      in_.fail("compressed by " + shown(compressor) + ", which is not read; save with zlib or uncompressed");
    raw_.format = "VTK XML";
    const pugi::xml_node grid = root.child("UnstructuredGrid");
    for (const pugi::xml_node piece : grid.children("Piece")) read_piece(piece);
    for (const pugi::xml_node field : grid.children("FieldData"))
      if (const pugi::xml_node array = find(field, "region_names")) take_vtk_names(raw_, strings(array));
    return std::move(raw_);
  }

 private:
  // The XML without raw appended data, which is none.
  void parse() {
    std::size_t size = bytes_.size();
    const std::size_t appended = bytes_.find("<AppendedData");
    if (appended != std::string::npos) {
      size = appended;
      in_.move_to(appended);
      const std::size_t end = bytes_.find('>', appended);
      const std::size_t begin = bytes_.find('_', std::min(end, bytes_.size()));
      if (begin == std::string::npos) in_.fail("the file ends early, within AppendedData");
      const std::string_view tag = std::string_view(bytes_).substr(appended, end - appended);
      appended_is_raw_ = tag.find("raw") != std::string_view::npos;
      appended_ = std::string_view(bytes_).substr(begin + 1);
      const std::size_t close = appended_.rfind("</AppendedData");
      if (close == std::string_view::npos) in_.fail("the file ends early, within AppendedData");
      appended_ = appended_.substr(0, close);
    }
    const std::string xml = bytes_.substr(0, size) + (size < bytes_.size() ? "</VTKFile>" : "");
    const pugi::xml_parse_result result =
        document_.load_buffer(xml.data(), xml.size(), pugi::parse_default, pugi::encoding_utf8);
    in_.move_to(static_cast<std::uint64_t>(
        std::clamp<std::ptrdiff_t>(result.offset, 0, static_cast<std::ptrdiff_t>(size))));
    if (!result) in_.fail(std::string("is no whole XML: ") + result.description());
    in_.move_to(0);
  }

  static pugi::xml_node find(const pugi::xml_node& parent, const char* name) {
    return parent.find_child_by_attribute("DataArray", "Name", name);
  }

  // Where errors point to from now on.
  void go_to(const pugi::xml_node& node, const char* what) {
    in_.move_to(static_cast<std::uint64_t>(std::max<std::ptrdiff_t>(node.offset_debug(), 0)));
    in_.at(what);
  }

  // Between an array's tags. Their line is where errors point to.
  std::string_view text_of(const pugi::xml_node& array) {
    const std::size_t open =
        bytes_.find('>', static_cast<std::size_t>(std::max<std::ptrdiff_t>(array.offset_debug(), 0)));
    const std::size_t close = bytes_.find('<', std::min(open, bytes_.size()));
    if (close == std::string::npos || bytes_[open - 1] == '/') return {};
    return std::string_view(bytes_).substr(open + 1, close - open - 1);
  }

  std::uint64_t header_number(const std::string& bytes, std::size_t i) const {
    const std::int64_t n =
        decode_integer(bytes.data() + i * static_cast<std::size_t>(header_.size), header_, in_.swapped);
    if (n < 0) in_.fail("the size of its data is damaged");
    return static_cast<std::uint64_t>(n);
  }

  // take(n) hands over the next n bytes.
  template <class Take>
  std::string data(Take&& take) const {
    const auto width = static_cast<std::uint64_t>(header_.size);
    if (!compressed_) return take(header_number(take(width), 0));
    const std::string head = take(3 * width);
    const std::uint64_t blocks = header_number(head, 0), full = header_number(head, 1),
                        last = header_number(head, 2);
    if (blocks > bytes_.size()) in_.fail("the number of its blocks is damaged");
    const std::string sizes = take(blocks * width);
    std::string out;
    for (std::uint64_t b = 0; b < blocks; ++b) {
      const std::string block = take(header_number(sizes, b));
      uLongf size = b + 1 == blocks && last > 0 ? last : full;
      if (size / 1040 > block.size()) in_.fail("the size of its blocks is damaged");  // zlib packs 1032 to 1
      const std::size_t at = out.size();
      out.resize(at + size);
      const uLongf expected = size;
      if (uncompress(reinterpret_cast<Bytef*>(out.data() + at), &size,
                     reinterpret_cast<const Bytef*>(block.data()), block.size()) != Z_OK ||
          size != expected)
        in_.fail("its compressed data is damaged");
    }
    return out;
  }

  std::string binary(const pugi::xml_node& array) {
    const std::string_view format = array.attribute("format").value();
    std::string_view from = format == "binary" ? text_of(array) : appended_;
    if (format == "appended") {
      const std::uint64_t offset = array.attribute("offset").as_ullong(~std::uint64_t{0});
      if (offset > from.size()) in_.fail("its offset lies beyond the appended data");
      from.remove_prefix(static_cast<std::size_t>(offset));
    } else if (format != "binary") {
      in_.fail("unknown format " + shown(format));
    }
    if (format == "appended" && appended_is_raw_)
      return data([&](std::uint64_t size) {
        if (size > from.size()) in_.fail("its data ends early");
        const std::string out(from.substr(0, static_cast<std::size_t>(size)));
        from.remove_prefix(static_cast<std::size_t>(size));
        return out;
      });
    Base64Reader base64(in_, from);
    return data([&](std::uint64_t size) { return base64.take(size); });
  }

  template <class T, class Text, class Decode>
  std::vector<T> numbers(const pugi::xml_node& array, const char* what, Text&& text, Decode&& decode) {
    if (!array) in_.fail(fmt::format("has no array {}", what));
    go_to(array, what);
    const NumberType type = number_type(array.attribute("type").value());
    if (type.size == 0 || (std::is_same_v<T, std::int64_t> && type.kind == 'f'))
      in_.fail("does not hold numbers of type " + shown(array.attribute("type").value()));
    std::vector<T> values;
    if (std::string_view(array.attribute("format").value()) == "ascii") {
      const std::string_view body = text_of(array);
      if (body.empty()) return values;
      const auto begin = static_cast<std::size_t>(body.data() - bytes_.data());
      Scanner in(file_, std::string_view(bytes_).substr(0, begin + body.size()));
      in.at(what);
      in.move_to(begin);
      while (!in.at_end()) values.push_back(text(in));
      return values;
    }
    const std::string bytes = binary(array);
    const auto width = static_cast<std::size_t>(type.size);
    if (bytes.size() % width) in_.fail("holds no whole number of numbers");
    values.resize(bytes.size() / width);
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = decode(bytes.data() + i * width, type);
    return values;
  }
  std::vector<double> reals(const pugi::xml_node& array, const char* what) {
    return numbers<double>(
        array, what, [](Scanner& in) { return in.number(); },
        [&](const char* from, NumberType t) { return decode_number(from, t, in_.swapped); });
  }
  std::vector<std::int64_t> integers(const pugi::xml_node& array, const char* what) {
    return numbers<std::int64_t>(
        array, what, [](Scanner& in) { return in.integer(); },
        [&](const char* from, NumberType t) { return decode_integer(from, t, in_.swapped); });
  }

  // Codes of characters (text) or the characters; a zero ends each string.
  std::vector<std::string> strings(const pugi::xml_node& array) {
    go_to(array, "region_names");
    std::string characters;
    if (std::string_view(array.attribute("format").value()) == "ascii") {
      Scanner in(file_, text_of(array));
      while (!in.at_end()) characters += static_cast<char>(in.integer());
    } else {
      characters = binary(array);
    }
    std::vector<std::string> list;
    for (std::size_t at = 0; at < characters.size();) {
      const std::size_t end = std::min(characters.find('\0', at), characters.size());
      list.push_back(characters.substr(at, end - at));
      at = end + 1;
    }
    return list;
  }

  void read_piece(const pugi::xml_node& piece) {
    const auto first = static_cast<std::int64_t>(raw_.nodes.size());
    const std::uint64_t points = piece.attribute("NumberOfPoints").as_ullong();
    const std::uint64_t cells = piece.attribute("NumberOfCells").as_ullong();
    if (points == 0 && cells == 0) return;
    go_to(piece, "Piece");
    const std::vector<double> x = reals(piece.child("Points").child("DataArray"), "Points");
    if (x.size() % 3 || x.size() / 3 != points)
      in_.fail(fmt::format("holds {} coordinates for {} points", x.size(), points));
    for (std::size_t i = 0; i < x.size(); i += 3) raw_.nodes.push_back({x[i], x[i + 1], x[i + 2]});
    const pugi::xml_node list = piece.child("Cells");
    const std::vector<std::int64_t> connectivity = integers(find(list, "connectivity"), "connectivity");
    std::vector<std::int64_t> offsets = integers(find(list, "offsets"), "offsets");
    const std::vector<std::int64_t> types = integers(find(list, "types"), "types");
    if (types.size() != cells || offsets.size() != cells)
      in_.fail(
          fmt::format("holds {} types and {} offsets for {} cells", types.size(), offsets.size(), cells));
    offsets.insert(offsets.begin(), 0);
    CellArrays arrays;
    for (const pugi::xml_node array : piece.child("CellData").children("DataArray"))
      if (array.attribute("NumberOfComponents").as_int(1) == 1)
        if (std::vector<double>* values = arrays.of(array.attribute("Name").value()))
          *values = reals(array, array.attribute("Name").value());
    take_vtk_cells(raw_, connectivity, offsets, types, arrays, first, in_);
  }

  const std::string& file_;
  const std::string& bytes_;
  Scanner in_;
  pugi::xml_document document_;
  std::string_view appended_;
  bool appended_is_raw_ = false, compressed_ = false;
  NumberType header_{4, 'u'};
  RawTets raw_;
};

}  // namespace

RawTets read_vtu(const std::string& file, const std::string& bytes) { return VtuReader(file, bytes).read(); }

}  // namespace palpate
