#include "palpate/io/tet_file.hpp"

#include <cmath>
#include <limits>

#include "palpate/base/error.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/io/tet_formats.hpp"

namespace palpate {

namespace fs = std::filesystem;

double decode_number(const char* from, NumberType type, bool swapped) {
  if (type.kind != 'f') {
    const std::int64_t n = decode_integer(from, type, swapped);
    return static_cast<double>(n);
  }
  std::array<char, 8> b{};
  std::memcpy(b.data(), from, static_cast<std::size_t>(type.size));
  if (swapped) std::reverse(b.begin(), b.begin() + type.size);
  double d;
  float f;
  std::memcpy(&d, b.data(), 8), std::memcpy(&f, b.data(), 4);
  return type.size == 8 ? d : static_cast<double>(f);
}

std::int64_t decode_integer(const char* from, NumberType type, bool swapped) {
  std::uint64_t n = 0;
  for (int i = 0; i < type.size; ++i)
    n |= std::uint64_t{static_cast<unsigned char>(from[swapped ? type.size - 1 - i : i])} << (8 * i);
  const int unused = 64 - 8 * type.size;
  return type.kind == 's' ? static_cast<std::int64_t>(n << unused) >> unused : static_cast<std::int64_t>(n);
}

void take_vtk_cells(RawTets& raw, const std::vector<std::int64_t>& connectivity,
                    const std::vector<std::int64_t>& offsets, const std::vector<std::int64_t>& types,
                    const CellArrays& arrays, std::int64_t first_node, const Scanner& in) {
  const auto require_one_a_cell = [&](const std::vector<double>& values, const char* what) {
    if (!values.empty() && values.size() != types.size())
      in.fail(fmt::format("{} {} for {} cells", values.size(), what, types.size()));
  };
  require_one_a_cell(arrays.regions, "region numbers");
  for (const auto& values : arrays.material) require_one_a_cell(values, "values of a material");
  for (std::size_t i = 0; i < types.size(); ++i) {
    const std::int64_t begin = offsets[i], end = offsets[i + 1];
    if (begin < 0 || end < begin || static_cast<std::uint64_t>(end) > connectivity.size())
      in.fail(fmt::format("cell {} has corners {} to {} of {}", i, begin, end, connectivity.size()));
    const bool quadratic = types[i] == 24, any_order = types[i] == 71;
    if (types[i] != 10 && !quadratic && !any_order) {
      ++raw.other_cells;
      continue;
    }
    if (any_order ? end - begin < 4 : end - begin != (quadratic ? 10 : 4))
      in.fail(fmt::format("cell {} is a tetrahedron of {} corners", i, end - begin));
    std::array<std::int64_t, 4> t;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::int64_t v = connectivity[static_cast<std::size_t>(begin) + k];
      if (v < 0 || v >= static_cast<std::int64_t>(raw.nodes.size()) - first_node)
        in.fail(fmt::format("cell {} uses point {} of {}", i, v,
                            static_cast<std::int64_t>(raw.nodes.size()) - first_node));
      t[k] = v + first_node;
    }
    raw.tets.push_back(t);
    raw.higher_order += end - begin > 4;
    raw.tags.push_back(arrays.regions.empty() ? 0.0 : arrays.regions[i]);
    for (std::size_t m = 0; m < arrays.material.size(); ++m)
      if (!arrays.material[m].empty()) raw.material[m].push_back(arrays.material[m][i]);
  }
}

void take_vtk_names(RawTets& raw, const std::vector<std::string>& names) {
  for (std::size_t i = 0; i < names.size(); ++i) raw.names[static_cast<double>(i)] = names[i];
}

// Regions: our name, VMTK's, meshio's. Materials: our names, and those of convert.
std::vector<double>* CellArrays::of(std::string_view name) {
  std::vector<double>* found = name == "region" || name == "CellEntityIds" || name == "gmsh:physical"
                                   ? &regions
                               : name == "young" || name == "young_Pa"        ? &material[0]
                               : name == "poisson"                            ? &material[1]
                               : name == "density" || name == "density_kg_m3" ? &material[2]
                                                                              : nullptr;
  return found && found->empty() ? found : nullptr;
}

namespace {

std::string lower_extension(const fs::path& path) {
  std::string e = path.extension().string();
  for (char& c : e) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return e;
}

enum class Kind { none, gmsh, medit, medit_binary, vtk, vtu, tetgen };

Kind kind_of(const fs::path& path, std::string_view start) {
  const std::string extension = lower_extension(path);
  if (extension == ".node" || extension == ".ele") return Kind::tetgen;
  std::int32_t mark = 0, version = 0;
  if (start.size() >= 8) std::memcpy(&mark, start.data(), 4), std::memcpy(&version, start.data() + 4, 4);
  if ((mark == 1 && version >= 1 && version <= 4) ||
      (mark == 1 << 24 && version >= 1 << 24 && version <= 4 << 24))
    return Kind::medit_binary;
  Scanner in({}, start, '#');
  if (start.substr(0, 5) == "# vtk") {
    // A legacy file may hold other things; its fourth line says so.
    const std::size_t dataset = start.find("DATASET");
    return dataset == std::string_view::npos ||
                   start.substr(dataset, 40).find("UNSTRUCTURED_GRID") != std::string_view::npos
               ? Kind::vtk
               : Kind::none;
  }
  const std::string_view word = in.peek_word();
  if (word == "$MeshFormat" || word == "$NOD" || word == "$Comments" || word == "$PhysicalNames")
    return Kind::gmsh;
  if (word == "MeshVersionFormatted") return Kind::medit;
  if (start.find("<VTKFile") != std::string_view::npos)
    return start.find("\"UnstructuredGrid\"") != std::string_view::npos ? Kind::vtu : Kind::none;
  if (extension == ".msh") return Kind::gmsh;
  if (extension == ".mesh") return Kind::medit;
  if (extension == ".meshb") return Kind::medit_binary;
  if (extension == ".vtu") return Kind::vtu;
  return extension == ".vtk" ? Kind::vtk : Kind::none;
}

// Index of each node number, whatever gaps and order there are.
class Numbering {
 public:
  Numbering(const std::string& file, const RawTets& raw) : raw_(raw) {
    if (raw.numbers.empty()) return;
    order_.resize(raw.numbers.size());
    for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = {raw.numbers[i], static_cast<Index>(i)};
    std::sort(order_.begin(), order_.end());
    for (std::size_t i = 1; i < order_.size(); ++i)
      if (order_[i].first == order_[i - 1].first)
        throw Error(ErrorKind::format, "{}: node {} is there twice", file, order_[i].first);
    dense_ = !order_.empty() && static_cast<std::uint64_t>(order_.back().first) -
                                        static_cast<std::uint64_t>(order_.front().first) + 1 ==
                                    order_.size();
  }
  // -1: there is none.
  Index index(std::int64_t number) const {
    if (raw_.numbers.empty()) {
      const std::uint64_t i =
          static_cast<std::uint64_t>(number) - static_cast<std::uint64_t>(raw_.first_number);
      return i < raw_.nodes.size() ? static_cast<Index>(i) : -1;
    }
    if (dense_) {
      const std::uint64_t i =
          static_cast<std::uint64_t>(number) - static_cast<std::uint64_t>(order_.front().first);
      return i < order_.size() ? order_[static_cast<std::size_t>(i)].second : -1;
    }
    const auto found = std::lower_bound(order_.begin(), order_.end(), std::pair(number, Index{0}));
    return found != order_.end() && found->first == number ? found->second : -1;
  }

 private:
  const RawTets& raw_;
  std::vector<std::pair<std::int64_t, Index>> order_;
  bool dense_ = false;
};

// Regions in the order of their numbers in the file.
void name_regions(const std::string& file, const RawTets& raw, TetMesh& mesh) {
  if (raw.tags.empty()) {
    mesh.regions.assign(mesh.tets.size(), 0);
    mesh.region_names = {"tissue"};
    return;
  }
  std::map<double, Index> region;
  for (std::size_t i = 0; i < raw.tags.size(); ++i) {
    if (!std::isfinite(raw.tags[i]))
      throw Error(ErrorKind::format, "{}: the region of tetrahedron {} is no number", file, i);
    region.emplace(raw.tags[i], 0);
    if (region.size() > 1000000) throw Error(ErrorKind::format, "{}: has more than a million regions", file);
  }
  for (auto& [tag, index] : region) {
    index = static_cast<Index>(mesh.region_names.size());
    const auto name = raw.names.find(tag);
    if (name != raw.names.end() && !name->second.empty())
      mesh.region_names.push_back(name->second);
    else
      mesh.region_names.push_back(region.size() == 1 ? "tissue" : fmt::format("region {}", tag));
  }
  for (const double tag : raw.tags) mesh.regions.push_back(region.at(tag));
}

TetFile finish(const std::string& file, RawTets raw, double unit) {
  if (raw.tets.empty())
    throw Error(ErrorKind::format, "{}: holds no tetrahedra ({} nodes, {} other cells)", file,
                raw.nodes.size(), raw.other_cells);
  constexpr auto most = static_cast<std::size_t>(std::numeric_limits<Index>::max() / 4);
  if (raw.nodes.size() > most || raw.tets.size() > most)
    throw Error(ErrorKind::resource, "{}: {} nodes and {} tetrahedra are more than 32-bit numbers hold", file,
                raw.nodes.size(), raw.tets.size());
  TetFile result;
  TetMesh& mesh = result.mesh;
  const Numbering numbering(file, raw);
  std::vector<Index> kept(raw.nodes.size(), -1);
  mesh.tets.resize(raw.tets.size());
  for (std::size_t i = 0; i < raw.tets.size(); ++i)
    for (std::size_t k = 0; k < 4; ++k) {
      const Index v = numbering.index(raw.tets[i][k]);
      if (v < 0)
        throw Error(ErrorKind::format, "{}: tetrahedron {} of the file uses node {}, which is not there",
                    file, i + 1, raw.tets[i][k]);
      mesh.tets[i][k] = v;
      kept[static_cast<std::size_t>(v)] = 0;
    }
  for (std::size_t v = 0; v < kept.size(); ++v) {
    if (kept[v] < 0) {
      ++result.unused_nodes;
      continue;
    }
    const Vec3 p = raw.nodes[v] * unit;
    if (!p.allFinite())
      throw Error(ErrorKind::format, "{}: node {} has a coordinate that is no finite number", file,
                  raw.numbers.empty() ? raw.first_number + static_cast<std::int64_t>(v) : raw.numbers[v]);
    kept[v] = static_cast<Index>(mesh.nodes.size());
    mesh.nodes.push_back(p);
  }
  for (Tetrahedron& t : mesh.tets)
    for (Index& v : t) v = kept[static_cast<std::size_t>(v)];
  name_regions(file, raw, mesh);
  for (const Tetrahedron& t : mesh.tets) result.inverted += six_volume(mesh, t) < 0;
  for (const auto& values : raw.material)
    if (!values.empty() && values.size() != raw.tets.size())
      throw Error(ErrorKind::format, "{}: a material's cell array is in some of its pieces only", file);
  result.young = std::move(raw.material[0]), result.poisson = std::move(raw.material[1]);
  result.density = std::move(raw.material[2]);
  result.format = raw.format;
  result.higher_order = raw.higher_order, result.other_cells = raw.other_cells;
  return result;
}

RawTets read_raw(const fs::path& path) {
  const std::string file = path.string(), bytes = read_file(path);
  if (bytes.empty()) throw Error(ErrorKind::format, "{}: is empty", file);
  Scanner in(file, bytes), commented(file, bytes, '#');
  switch (kind_of(path, std::string_view(bytes).substr(0, 4096))) {
    case Kind::gmsh:
      return read_gmsh(in);
    case Kind::medit:
      return read_medit(commented);
    case Kind::medit_binary:
      return read_medit_binary(in);
    case Kind::vtk:
      return read_vtk_legacy(in);
    case Kind::vtu:
      return read_vtu(file, bytes);
    case Kind::tetgen: {
      const bool has_nodes = lower_extension(path) == ".node";
      const fs::path other = fs::path(path).replace_extension(has_nodes ? ".ele" : ".node");
      const std::string other_bytes = read_file(other);
      Scanner beside(other.string(), other_bytes, '#');
      return has_nodes ? read_tetgen(commented, beside) : read_tetgen(beside, commented);
    }
    case Kind::none:
      break;
  }
  throw Error(ErrorKind::format,
              "{}: is no tetrahedral mesh that is read here (.msh .mesh .meshb .vtk .vtu .node)", file);
}

}  // namespace

bool is_tet_file(const fs::path& path) {
  char start[4096];
  std::ifstream in(path, std::ios::binary);
  in.read(start, sizeof start);
  return kind_of(path, {start, static_cast<std::size_t>(in.gcount())}) != Kind::none;
}

TetFile read_tets(const fs::path& path, double unit) { return finish(path.string(), read_raw(path), unit); }

}  // namespace palpate
