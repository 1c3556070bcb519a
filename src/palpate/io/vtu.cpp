#include "palpate/io/vtu.hpp"

#include <limits>

#include "palpate/base/error.hpp"
#include "palpate/io/atomic_file.hpp"

namespace palpate {
namespace {

constexpr char base64_digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

// Bytes to base64 text, streamed.
class Base64 {
 public:
  explicit Base64(AtomicFile& file) : file_(file) {}
  void add(const void* data, std::size_t size) {
    const auto* p = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) {
      carry_ = carry_ << 8 | p[i];
      if (++filled_ == 3) put(4);
    }
  }
  void finish() {
    if (filled_) {
      const int digits = filled_ + 1;
      carry_ <<= 8 * (3 - filled_);
      put(digits);
      text_.append(static_cast<std::size_t>(4 - digits), '=');
    }
    file_.write(text_);
    text_.clear();
  }

 private:
  void put(int digits) {
    for (int d = 0; d < digits; ++d) text_ += base64_digits[carry_ >> (18 - 6 * d) & 63];
    carry_ = 0, filled_ = 0;
    if (text_.size() >= 1 << 16) file_.write(text_), text_.clear();
  }
  AtomicFile& file_;
  std::string text_;
  std::uint32_t carry_ = 0;
  int filled_ = 0;
};

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '"')
      out += "&quot;";
    else if (static_cast<unsigned char>(c) < 0x20)
      out += ' ';
    else
      out += c;
  }
  return out;
}

template <class T>
constexpr const char* vtk_type() {
  if constexpr (std::is_same_v<T, double>) return "Float64";
  if constexpr (std::is_same_v<T, float>) return "Float32";
  if constexpr (std::is_same_v<T, std::int32_t>) return "Int32";
  if constexpr (std::is_same_v<T, std::uint8_t>) return "UInt8";
}

// The header (bytes that follow) and the data are one base64 text when nothing is compressed.
template <class T>
void data_array(AtomicFile& file, const std::string& name, int components, const T* data, std::size_t size,
                const std::string& more = {}) {
  file.write(
      fmt::format("<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\"{} format=\"binary\">\n",
                  vtk_type<T>(), escaped(name), components, more));
  Base64 text(file);
  const std::uint64_t bytes = size * sizeof(T);
  text.add(&bytes, sizeof bytes);
  text.add(data, bytes);
  text.finish();
  file.write("\n</DataArray>\n");
}

void fields(AtomicFile& file, const char* tag, const std::vector<VtuField>& list, std::size_t count,
            const std::vector<Index>* regions) {
  file.write(fmt::format("<{}>\n", tag));
  if (regions) data_array(file, "region", 1, regions->data(), regions->size());
  for (const VtuField& f : list) {
    if (f.components < 1 || f.values.size() != count * static_cast<std::size_t>(f.components))
      throw Error(ErrorKind::internal, "field {}: {} values for {} of {} components", f.name, f.values.size(),
                  count, f.components);
    data_array(file, f.name, f.components, f.values.data(), f.values.size());
  }
  file.write(fmt::format("</{}>\n", tag));
}

// The characters' codes, each name ended by a zero: VTK has strings, but not all readers of its files do.
void region_names(AtomicFile& file, const std::vector<std::string>& names) {
  std::vector<std::uint8_t> codes;
  for (const std::string& name : names) {
    codes.insert(codes.end(), name.begin(), name.end());
    codes.push_back(0);
  }
  file.write("<FieldData>\n");
  data_array(file, "region_names", 1, codes.data(), codes.size(),
             fmt::format(" NumberOfTuples=\"{}\"", codes.size()));
  file.write("</FieldData>\n");
}

template <std::size_t corners>
void write_grid(const std::filesystem::path& path, std::span<const Vec3> points,
                std::span<const std::array<Index, corners>> cells, const TetMesh* mesh,
                const std::vector<VtuField>& point_fields, const std::vector<VtuField>& cell_fields) {
  static_assert(sizeof(Vec3) == 3 * sizeof(double));
  if (cells.size() > std::numeric_limits<std::int32_t>::max() / corners)
    throw Error(ErrorKind::resource, "{}: {} cells are more than the 32-bit offsets written here hold",
                path.string(), cells.size());
  AtomicFile file(path);
  file.write(
      fmt::format("<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
                  "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<UnstructuredGrid>\n"));
  if (mesh) region_names(file, mesh->region_names);
  file.write(
      fmt::format("<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n", points.size(), cells.size()));
  fields(file, "PointData", point_fields, points.size(), nullptr);
  fields(file, "CellData", cell_fields, cells.size(), mesh ? &mesh->regions : nullptr);
  file.write("<Points>\n");
  data_array(file, "Points", 3, reinterpret_cast<const double*>(points.data()), 3 * points.size());
  file.write("</Points>\n<Cells>\n");
  data_array(file, "connectivity", 1, reinterpret_cast<const Index*>(cells.data()), corners * cells.size());
  std::vector<std::int32_t> offsets(cells.size());
  for (std::size_t i = 0; i < offsets.size(); ++i) offsets[i] = static_cast<std::int32_t>(corners * (i + 1));
  data_array(file, "offsets", 1, offsets.data(), offsets.size());
  const std::vector<std::uint8_t> types(cells.size(), corners == 3 ? 5 : 10);
  data_array(file, "types", 1, types.data(), types.size());
  file.write("</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
  file.commit();
}

}  // namespace

void write_vtu(const std::filesystem::path& path, std::span<const Vec3> points,
               std::span<const Triangle> triangles, const std::vector<VtuField>& point_fields,
               const std::vector<VtuField>& cell_fields) {
  write_grid(path, points, triangles, nullptr, point_fields, cell_fields);
}

void write_vtu(const std::filesystem::path& path, const TetMesh& mesh,
               const std::vector<VtuField>& point_fields, const std::vector<VtuField>& cell_fields) {
  if (mesh.regions.size() != mesh.tets.size())
    throw Error(ErrorKind::internal, "{}: {} tetrahedra but {} region entries", path.string(),
                mesh.tets.size(), mesh.regions.size());
  write_grid(path, std::span<const Vec3>(mesh.nodes), std::span<const Tetrahedron>(mesh.tets), &mesh,
             point_fields, cell_fields);
}

void write_pvd(const std::filesystem::path& path, std::span<const PvdEntry> entries) {
  AtomicFile file(path);
  file.write(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" "
      "byte_order=\"LittleEndian\">\n<Collection>\n");
  for (const PvdEntry& e : entries)
    file.write(fmt::format("<DataSet timestep=\"{}\" part=\"0\" file=\"{}\"/>\n", e.time, escaped(e.file)));
  file.write("</Collection>\n</VTKFile>\n");
  file.commit();
}

}  // namespace palpate
