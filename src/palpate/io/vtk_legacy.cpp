// VTK's legacy files of unstructured grids, text and binary, with cells as in versions 1 to 4 and as in 5.
// "VTK File Formats", VTK User's Guide.
#include <charconv>

#include "palpate/io/tet_formats.hpp"

namespace palpate {

namespace {

NumberType number_type(std::string_view name) {
  static const std::map<std::string_view, NumberType> types{
      {"char", {1, 's'}},          {"signed_char", {1, 's'}},    {"unsigned_char", {1, 'u'}},
      {"short", {2, 's'}},         {"unsigned_short", {2, 'u'}}, {"int", {4, 's'}},
      {"unsigned_int", {4, 'u'}},  {"long", {8, 's'}},           {"unsigned_long", {8, 'u'}},
      {"vtktypeint64", {8, 's'}},  {"vtktypeuint64", {8, 'u'}},  {"vtktypeint32", {4, 's'}},
      {"vtktypeuint32", {4, 'u'}}, {"vtkIdType", {4, 's'}},      {"vtkidtype", {4, 's'}},
      {"float", {4, 'f'}},         {"double", {8, 'f'}}};
  const auto found = types.find(name);
  return found == types.end() ? NumberType{0, 0} : found->second;
}

std::vector<std::string> words_of(std::string_view line) {
  Scanner in({}, line);
  std::vector<std::string> words;
  while (!in.at_end()) words.emplace_back(in.word());
  return words;
}

// Names hold no white space: it is written as %20.
std::string decoded(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned code = 0;
    if (text[i] == '%' && i + 2 < text.size() &&
        std::from_chars(&text[i + 1], &text[i + 1] + 2, code, 16).ptr == &text[i + 1] + 2)
      out += static_cast<char>(code), i += 2;
    else
      out += text[i];
  }
  return out;
}

class LegacyReader {
 public:
  explicit LegacyReader(Scanner& in) : in_(in) { in_.swapped = true; }

  RawTets read() {
    header();
    while (!in_.at_end()) {
      in_.at(nullptr);
      keyword_line();
    }
    in_.at(nullptr);
    if (!binary_) in_.require_line_end();
    if (types_.size() + 1 != std::max<std::size_t>(offsets_.size(), 1))
      in_.fail(fmt::format("{} cells but {} cell types", offsets_.empty() ? 0 : offsets_.size() - 1,
                           types_.size()));
    take_vtk_cells(raw_, connectivity_, offsets_, types_, cell_arrays_, 0, in_);
    take_vtk_names(raw_, names_);
    return std::move(raw_);
  }

 private:
  void header() {
    const std::vector<std::string> first = words_of(in_.line());
    if (first.empty()) in_.fail("expected \"# vtk DataFile Version\", found an empty line");
    Scanner version({}, first.back());
    newer_cells_ = first.size() == 5 && version.number() >= 5;
    const std::vector<std::string> title = words_of(in_.line());
    if (!title.empty() && title[0] == "regions:")
      for (std::size_t i = 1; i < title.size(); ++i) names_.push_back(decoded(title[i]));
    const std::string kind(in_.word());
    in_.line();
    binary_ = kind == "BINARY";
    if (!binary_ && kind != "ASCII") in_.fail("expected ASCII or BINARY, found " + shown(kind));
    raw_.format = binary_ ? "VTK legacy binary" : "VTK legacy text";
  }

  void keyword_line() {
    const std::vector<std::string> words = words_of(in_.line());
    const std::string& key = words[0];
    const auto word = [&](std::size_t i) -> const std::string& {
      if (i >= words.size()) in_.fail(key + " lacks a word");
      return words[i];
    };
    const auto size = [&](std::size_t i) {
      Scanner text({}, word(i));
      const std::int64_t n = text.integer();
      return in_.count(n, 1);
    };
    if (key == "DATASET") {
      if (word(1) != "UNSTRUCTURED_GRID") in_.fail("holds " + shown(word(1)) + ", not an unstructured grid");
    } else if (key == "METADATA") {
      metadata();
    } else if (key == "FIELD") {
      field(size(2));
    } else if (key == "POINTS") {
      points(size(1), word(2));
    } else if (key == "CELLS") {
      newer_cells_ ? cells5(size(1), size(2)) : cells(size(1), size(2));
    } else if (key == "CELL_TYPES") {
      in_.at("cell types");
      types_ = integers(size(1), "int");
    } else if (key == "POINT_DATA" || key == "CELL_DATA") {
      cell_data_ = key == "CELL_DATA", tuples_ = size(1);
    } else if (key == "SCALARS") {
      if (in_.peek_word() == "LOOKUP_TABLE") in_.line();
      array(word(1), word(2), words.size() > 3 ? size(3) : 1, tuples_);
    } else if (key == "VECTORS" || key == "NORMALS") {
      array(word(1), word(2), 3, tuples_);
    } else if (key == "TENSORS" || key == "TENSORS6") {
      array(word(1), word(2), key == "TENSORS" ? 9 : 6, tuples_);
    } else if (key == "TEXTURE_COORDINATES") {
      array(word(1), word(3), size(2), tuples_);
    } else if (key == "GLOBAL_IDS" || key == "PEDIGREE_IDS" || key == "EDGE_FLAGS") {
      array(word(1), word(2), 1, tuples_);
    } else if (key == "COLOR_SCALARS") {
      array({}, binary_ ? "unsigned_char" : "float", size(2), tuples_);
    } else if (key == "LOOKUP_TABLE") {
      array({}, binary_ ? "unsigned_char" : "float", 4, size(2));
    } else {
      in_.fail("unknown keyword " + shown(key));
    }
  }

  // Up to the next empty line.
  void metadata() {
    while (in_.left() > 0 && in_.line().find_first_not_of(" \t") != std::string_view::npos) {
    }
  }

  // `n` numbers; in a text file `each` is one of them.
  template <class T, class Text, class Decode>
  std::vector<T> numbers(std::uint64_t n, const std::string& type_name, Text&& text, Decode&& decode) {
    const NumberType type = number_type(type_name);
    if (type.size == 0) in_.fail("numbers of type " + shown(type_name) + " are not known");
    std::vector<T> values;
    if (!binary_) {
      values.resize(in_.count(static_cast<std::int64_t>(n), 1));
      for (T& v : values) v = text();
      return values;
    }
    in_.binary = true;
    const auto width = static_cast<std::size_t>(type.size);
    const char* from = in_.take(in_.count(static_cast<std::int64_t>(n), width) * width).data();
    in_.binary = false;
    values.resize(n);
    for (std::size_t i = 0; i < n; ++i) values[i] = decode(from + i * width, type);
    return values;
  }
  std::vector<double> reals(std::uint64_t n, const std::string& type) {
    return numbers<double>(
        n, type, [&] { return in_.number(); },
        [](const char* from, NumberType t) { return decode_number(from, t, true); });
  }
  std::vector<std::int64_t> integers(std::uint64_t n, const std::string& type) {
    if (number_type(type).kind == 'f') in_.fail("expected whole numbers, not " + type);
    return numbers<std::int64_t>(
        n, type, [&] { return in_.integer(); },
        [](const char* from, NumberType t) { return decode_integer(from, t, true); });
  }

  void points(std::size_t n, const std::string& type) {
    in_.at("points");
    const std::vector<double> values = reals(3 * n, type);
    raw_.nodes.resize(n);
    for (std::size_t i = 0; i < n; ++i) raw_.nodes[i] = {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
  }

  void cells(std::size_t n, std::size_t size) {
    in_.at("cells");
    const std::vector<std::int64_t> list = integers(size, "int");
    offsets_.assign(1, 0), connectivity_.clear();
    for (std::size_t at = 0, i = 0; i < n; ++i) {
      in_.at("cell", static_cast<std::int64_t>(i));
      if (at >= list.size() || list[at] < 0 || static_cast<std::uint64_t>(list[at]) >= list.size() - at)
        in_.fail("its corners end beyond the list of cells");
      const std::size_t corners = static_cast<std::size_t>(list[at]);
      for (std::size_t k = 1; k <= corners; ++k) connectivity_.push_back(list[at + k]);
      at += corners + 1;
      offsets_.push_back(static_cast<std::int64_t>(connectivity_.size()));
    }
    if (connectivity_.size() + n != size) in_.fail("the list of cells is longer than its cells");
  }

  void cells5(std::size_t offsets, std::size_t corners) {
    for (const auto& [name, n, to] :
         {std::tuple("OFFSETS", offsets, &offsets_), std::tuple("CONNECTIVITY", corners, &connectivity_)}) {
      in_.at(name);
      if (in_.at_end()) in_.fail("the file ends early");
      const std::vector<std::string> words = words_of(in_.line());
      if (words.size() != 2 || words[0] != name) in_.fail(fmt::format("expected {} and a type", name));
      *to = integers(n, words[1]);
    }
  }

  void array(const std::string& name, const std::string& type, std::uint64_t components,
             std::uint64_t tuples) {
    in_.at("array");
    if (components > 1000000) in_.fail(fmt::format("{} components", components));
    if (type == "bit") {
      if (binary_)
        in_.take((components * tuples + 7) / 8);
      else
        reals(components * tuples, "int");
      return;
    }
    std::vector<double>* values = cell_data_ && components == 1 ? cell_arrays_.of(decoded(name)) : nullptr;
    if (values)
      *values = reals(tuples, type);
    else
      skip(components * tuples, type);
  }
  void skip(std::uint64_t n, const std::string& type) {
    const int width = number_type(type).size;
    if (!binary_ || width == 0)  // NaN is nothing to us here
      numbers<char>(
          n, type, [&] { return in_.word()[0]; }, [](const char*, NumberType) { return '\0'; });
    else
      in_.take(in_.count(static_cast<std::int64_t>(n), static_cast<std::size_t>(width)) *
               static_cast<std::uint64_t>(width));
  }

  void field(std::size_t arrays) {
    for (std::size_t a = 0; a < arrays; ++a) {
      in_.at("array of a FIELD");
      if (in_.at_end()) in_.fail("the file ends early");
      if (in_.peek_word() == "METADATA") metadata(), in_.at_end();
      const std::vector<std::string> words = words_of(in_.line());
      if (words.size() == 1 && words[0] == "NULL_ARRAY") continue;
      if (words.size() != 4) in_.fail("expected name, components, tuples and type");
      Scanner components({}, words[1]), tuples({}, words[2]);
      const std::size_t c = in_.count(components.integer(), 1), t = in_.count(tuples.integer(), 1);
      if (words[3] == "string") {
        const std::vector<std::string> list = strings(c * t);
        if (words[0] == "region_names") names_ = list;
      } else {
        array(words[0], words[3], c, t);
      }
    }
  }

  // Text: one a line, white space as %20. Binary: a length whose first two bits say how many bytes it has.
  std::vector<std::string> strings(std::uint64_t n) {
    std::vector<std::string> list(in_.count(static_cast<std::int64_t>(n), 1));
    for (std::string& s : list) {
      if (!binary_) {
        s = decoded(in_.line());
        continue;
      }
      std::uint64_t length = static_cast<unsigned char>(in_.take(1)[0]);
      const int more = length >= 0xc0 ? 0 : length >= 0x80 ? 1 : length >= 0x40 ? 3 : 7;
      length &= 0x3f;
      for (int i = 0; i < more; ++i) length = length << 8 | static_cast<unsigned char>(in_.take(1)[0]);
      s = in_.take(length);
    }
    return list;
  }

  Scanner& in_;
  RawTets raw_;
  bool binary_ = false, newer_cells_ = false, cell_data_ = false;
  std::size_t tuples_ = 0;
  std::vector<std::int64_t> connectivity_, offsets_, types_;
  CellArrays cell_arrays_;
  std::vector<std::string> names_;
};

}  // namespace

RawTets read_vtk_legacy(Scanner& in) { return LegacyReader(in).read(); }

}  // namespace palpate
