// Gmsh's .msh: 1 ($NOD, $ELM), 2.x and 4.1, text and binary. Gmsh reference manual, "File formats".
#include <cstdlib>
#include <unordered_map>

#include "palpate/io/tet_formats.hpp"

namespace palpate {

namespace {

// Nodes of an element of each type; 0: unknown.
std::size_t element_nodes(std::int64_t type) {
  static constexpr std::array<std::uint8_t, 32> nodes{0,  2,  3,  4,  4, 8, 6,  5,  3,  6, 9,
                                                      10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10,
                                                      12, 15, 15, 21, 4, 5, 6,  20, 35, 56};
  if (type == 92) return 64;
  if (type == 93) return 125;
  return type > 0 && type < 32 ? nodes[static_cast<std::size_t>(type)] : 0;
}

// Gmsh gives a group a minus sign where it is turned over.
std::int64_t unsigned_tag(std::int64_t tag) { return std::abs(std::max(tag, -std::int64_t{1} << 62)); }

bool is_tetrahedron(std::int64_t type) { return type == 4 || type == 11 || (type >= 29 && type <= 31); }

class GmshReader {
 public:
  explicit GmshReader(Scanner& in) : in_(in) {}

  RawTets read() {
    raw_.format = "Gmsh text";
    while (!in_.at_end()) {
      in_.at(nullptr);
      const std::string name(in_.word());
      if (name.size() < 2 || name[0] != '$')
        in_.fail("expected a section such as $Nodes, found " + shown(name));
      if (name == "$NOD" || name == "$ELM") version_ = 1, binary_ = false;
      const std::string end = (version_ == 1 ? "$END" : "$End") + name.substr(1);
      if (section(name)) {
        in_.at(nullptr);
        const std::string found(in_.word());
        if (found != end)
          in_.fail("expected " + end + ", found " + shown(found) + ": more than was announced");
      } else {
        in_.skip_past(end);
      }
    }
    return finish();
  }

 private:
  bool section(const std::string& name) {
    if (name == "$MeshFormat")
      format();
    else if (name == "$PhysicalNames")
      physical_names();
    else if (name == "$Entities")
      entities();
    else if (name == "$Nodes" || name == "$NOD")
      version_ == 4 ? nodes4() : nodes();
    else if (name == "$Elements" || name == "$ELM")
      version_ == 4 ? elements4() : version_ == 1 ? elements1() : binary_ ? elements2_binary() : elements2();
    else
      return false;
    return true;
  }

  void format() {
    const double version = in_.number();
    const std::int64_t type = in_.integer(), size = in_.integer();
    if (version >= 2 && version < 3)
      version_ = 2;
    else if (version == 4.1)
      version_ = 4;
    else
      in_.fail(fmt::format("Gmsh format {} is not read; save it as 4.1 or 2.2", version));
    if (type < 0 || type > 1 || size != 8) in_.fail("expected \"0 8\" or \"1 8\" after the version");
    raw_.format = fmt::format("Gmsh {} {}", version, type ? "binary" : "text");
    binary_ = type == 1;
    if (!binary_) return;
    begin_binary();
    const auto one = in_.raw<std::int32_t>();
    if (one == 0x01000000)
      in_.swapped = true;
    else if (one != 1)
      in_.fail("the mark of the byte order is damaged");
    in_.binary = false;
  }
  void begin_binary() {
    in_.line();
    in_.binary = true;
  }

  void physical_names() {
    const std::size_t n = in_.count(in_.integer(), 4);
    for (std::size_t i = 0; i < n; ++i) {
      in_.at("physical name", static_cast<std::int64_t>(i + 1));
      const std::int64_t dimension = in_.integer(), tag = in_.integer();
      const std::string_view rest = in_.line();
      const std::size_t first = rest.find('"'), last = rest.rfind('"');
      if (first == last) in_.fail("expected a name in double quotes");
      if (dimension == 3)
        raw_.names[static_cast<double>(unsigned_tag(tag))] = rest.substr(first + 1, last - first - 1);
    }
  }

  // Numbers as text or binary, by the file's kind.
  std::int64_t whole() { return binary_ ? in_.raw<std::int32_t>() : in_.integer(); }
  std::int64_t size() { return binary_ ? in_.raw<std::int64_t>() : in_.integer(); }
  double real() { return binary_ ? in_.raw<double>() : in_.number(); }

  // 4.1: which physical group a volume is in.
  void entities() {
    if (binary_) begin_binary();
    std::array<std::size_t, 4> counts;
    for (std::size_t& n : counts) n = in_.count(size(), 8);
    for (int dimension = 0; dimension < 4; ++dimension)
      for (std::size_t i = 0; i < counts[static_cast<std::size_t>(dimension)]; ++i) {
        in_.at("entity", static_cast<std::int64_t>(i + 1));
        const std::int64_t tag = whole();
        for (int c = dimension ? 6 : 3; c > 0; --c) real();
        const std::size_t groups = in_.count(size(), 2);
        for (std::size_t g = 0; g < groups; ++g) {
          const std::int64_t group = unsigned_tag(whole());
          if (dimension == 3 && g == 0) group_of_volume_[tag] = group;
        }
        if (dimension == 0) continue;
        const std::size_t bounds = in_.count(size(), 2);
        for (std::size_t b = 0; b < bounds; ++b) whole();
      }
    in_.binary = false;
  }

  Vec3 point() {
    const double x = real(), y = real(), z = real();
    return {x, y, z};
  }

  void nodes() {
    const std::size_t n = in_.count(in_.integer(), binary_ ? 28 : 8);
    if (binary_) begin_binary();
    raw_.nodes.reserve(raw_.nodes.size() + n), raw_.numbers.reserve(raw_.nodes.size() + n);
    for (std::size_t i = 0; i < n; ++i) {
      in_.at("node", static_cast<std::int64_t>(i + 1));
      raw_.numbers.push_back(whole());
      raw_.nodes.push_back(point());
    }
    in_.binary = false;
  }

  void nodes4() {
    if (binary_) begin_binary();
    const std::size_t blocks = in_.count(size(), 8);
    const std::size_t total = in_.count(size(), binary_ ? 32 : 8);
    size(), size();  // smallest and largest number
    raw_.nodes.reserve(raw_.nodes.size() + total), raw_.numbers.reserve(raw_.nodes.size() + total);
    for (std::size_t b = 0; b < blocks; ++b) {
      in_.at("block of nodes", static_cast<std::int64_t>(b + 1));
      const std::int64_t dimension = whole();
      whole();  // entity
      const std::int64_t parametric = whole();
      if (dimension < 0 || dimension > 3) in_.fail(fmt::format("dimension {}", dimension));
      const std::size_t n = in_.count(size(), binary_ ? 32 : 8);
      for (std::size_t i = 0; i < n; ++i) raw_.numbers.push_back(size());
      for (std::size_t i = 0; i < n; ++i) {
        in_.at("node", raw_.numbers[raw_.nodes.size()]);
        raw_.nodes.push_back(point());
        for (std::int64_t p = 0; parametric && p < dimension; ++p) real();
      }
    }
    in_.binary = false;
  }

  // The nodes of one element; the first four of a tetrahedron are its corners.
  template <class Read>
  void element(std::int64_t type, std::size_t count, std::int64_t physical, std::int64_t volume,
               Read&& read) {
    if (!is_tetrahedron(type) || count < 4) {
      for (std::size_t i = 0; i < count; ++i) read();
      ++raw_.other_cells;
      return;
    }
    std::array<std::int64_t, 4> t;
    for (std::int64_t& v : t) v = read();
    for (std::size_t i = 4; i < count; ++i) read();
    raw_.tets.push_back(t);
    raw_.higher_order += count > 4;
    physical_.push_back(unsigned_tag(physical)), volume_.push_back(volume);
  }

  std::size_t known_nodes(std::int64_t type) {
    const std::size_t n = element_nodes(type);
    if (n == 0) in_.fail(fmt::format("elements of type {} are not known", type));
    return n;
  }

  void elements1() {
    raw_.format = "Gmsh 1";
    const std::size_t n = in_.count(in_.integer(), 12);
    for (std::size_t i = 0; i < n; ++i) {
      in_.at("element", in_.integer());
      const std::int64_t type = in_.integer(), physical = in_.integer(), volume = in_.integer();
      const std::size_t count = in_.count(in_.integer(), 2);
      element(type, count, physical, volume, [&] { return in_.integer(); });
    }
  }

  void elements2() {
    const std::size_t n = in_.count(in_.integer(), 8);
    for (std::size_t i = 0; i < n; ++i) {
      in_.at("element", in_.integer());
      const std::int64_t type = in_.integer();
      const std::size_t tags = in_.count(in_.integer(), 2), count = known_nodes(type);
      std::array<std::int64_t, 2> first{};
      for (std::size_t t = 0; t < tags; ++t) {
        const std::int64_t tag = in_.integer();
        if (t < 2) first[t] = tag;
      }
      element(type, count, first[0], first[1], [&] { return in_.integer(); });
    }
  }

  void elements2_binary() {
    const std::size_t n = in_.count(in_.integer(), 8);
    begin_binary();
    for (std::size_t done = 0; done < n;) {
      in_.at("element", static_cast<std::int64_t>(done + 1));
      const auto type = in_.raw<std::int32_t>(), follow = in_.raw<std::int32_t>(),
                 tags = in_.raw<std::int32_t>();
      const std::size_t count = known_nodes(type), some = in_.count(follow, 4 * (1 + count));
      if (some == 0 || some > n - done) in_.fail(fmt::format("a block of {} elements of {}", some, n - done));
      in_.count(tags, 4);
      for (std::size_t i = 0; i < some; ++i) {
        in_.at("element", in_.raw<std::int32_t>());
        std::array<std::int64_t, 2> first{};
        for (int t = 0; t < tags; ++t) {
          const auto tag = in_.raw<std::int32_t>();
          if (t < 2) first[static_cast<std::size_t>(t)] = tag;
        }
        element(type, count, first[0], first[1], [&] { return std::int64_t{in_.raw<std::int32_t>()}; });
      }
      done += some;
    }
    in_.binary = false;
  }

  void elements4() {
    if (binary_) begin_binary();
    const std::size_t blocks = in_.count(size(), 8);
    in_.count(size(), binary_ ? 16 : 4);
    size(), size();  // smallest and largest number
    for (std::size_t b = 0; b < blocks; ++b) {
      in_.at("block of elements", static_cast<std::int64_t>(b + 1));
      whole();  // dimension
      const std::int64_t volume = whole(), type = whole();
      const std::size_t count = known_nodes(type), n = in_.count(size(), (binary_ ? 8 : 2) * (1 + count) - 1);
      for (std::size_t i = 0; i < n; ++i) {
        in_.at("element", size());
        element(type, count, 0, volume, [&] { return size(); });
      }
    }
    in_.binary = false;
  }

  RawTets finish() {
    if (version_ == 4)
      for (std::size_t i = 0; i < volume_.size(); ++i) {
        const auto found = group_of_volume_.find(volume_[i]);
        if (found != group_of_volume_.end()) physical_[i] = found->second;
      }
    const bool grouped =
        std::any_of(physical_.begin(), physical_.end(), [](std::int64_t t) { return t != 0; });
    const std::vector<std::int64_t>& tags = grouped ? physical_ : volume_;
    raw_.tags.assign(tags.begin(), tags.end());
    if (!grouped) raw_.names.clear();
    return std::move(raw_);
  }

  Scanner& in_;
  RawTets raw_;
  int version_ = 0;
  bool binary_ = false;
  std::vector<std::int64_t> physical_, volume_;  // groups of each tetrahedron
  std::unordered_map<std::int64_t, std::int64_t> group_of_volume_;
};

}  // namespace

RawTets read_gmsh(Scanner& in) { return GmshReader(in).read(); }

}  // namespace palpate
