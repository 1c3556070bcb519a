// NIfTI-1 and NIfTI-2 by their headers nifti1.h (Cox et al. 2004) and nifti2.h (2011).
#include "palpate/io/nifti.hpp"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/io/atomic_file.hpp"

namespace palpate {

namespace {

// The bytes of a file, inflated on the way where they are gzip. Nothing is allocated for what is not read.
class Source {
 public:
  Source(const std::string& bytes, const std::string& name)
      : bytes_(bytes), name_(name), packed_(bytes.compare(0, 2, "\x1f\x8b") == 0) {
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream_.avail_in = 0;
    if (packed_ && inflateInit2(&stream_, 15 + 16) != Z_OK)
      throw Error(ErrorKind::resource, "{}: zlib cannot start", name);
  }
  ~Source() {
    if (packed_) inflateEnd(&stream_);
  }
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;

  // Up to n bytes; fewer at the end. gzip checksums are compared as their ends are met.
  std::size_t read(char* to, std::size_t n) {
    if (!packed_) {
      n = std::min(n, bytes_.size() - at_);
      std::memcpy(to, bytes_.data() + at_, n);
      at_ += n;
      return n;
    }
    stream_.next_out = reinterpret_cast<Bytef*>(to);
    std::size_t done = 0;
    while (done < n && !ended_) {
      stream_.avail_out = static_cast<uInt>(std::min<std::size_t>(n - done, 1u << 30));
      const uInt room = stream_.avail_out;
      const std::size_t consumed =
          static_cast<std::size_t>(reinterpret_cast<const char*>(stream_.next_in) - bytes_.data());
      stream_.avail_in = static_cast<uInt>(std::min<std::size_t>(bytes_.size() - consumed, 1u << 30));
      const int status = inflate(&stream_, Z_NO_FLUSH);
      done += room - stream_.avail_out;
      if (status == Z_STREAM_END) {
        // gzip files may be several in a row
        if (stream_.avail_in < 2 || stream_.next_in[0] != 0x1f || inflateReset(&stream_) != Z_OK)
          ended_ = true;
      } else if (status == Z_BUF_ERROR) {
        throw Error(ErrorKind::format, "{}: the gzip data end too early: truncated", name_);
      } else if (status != Z_OK) {
        throw Error(ErrorKind::format, "{}: the gzip data are damaged ({})", name_,
                    stream_.msg ? stream_.msg : "zlib gives no reason");
      }
    }
    return done;
  }
  // Most bytes there can be from here on: deflate packs 1032 bytes into one at best.
  std::uint64_t most() const { return packed_ ? 1032 * std::uint64_t{bytes_.size()} : bytes_.size() - at_; }
  bool packed() const { return packed_; }

 private:
  const std::string& bytes_;
  const std::string& name_;
  bool packed_, ended_ = false;
  std::size_t at_ = 0;
  z_stream stream_{};
};

template <class T>
T load(const char* from, bool swap) {
  char raw[sizeof(T)];
  for (std::size_t i = 0; i < sizeof(T); ++i) raw[i] = from[swap ? sizeof(T) - 1 - i : i];
  T t;
  std::memcpy(&t, raw, sizeof t);
  return t;
}

// What both versions say, in one form.
struct Header {
  bool swap = false;
  std::array<std::int64_t, 8> dim{};
  int datatype = 0, qform = 0, sform = 0, units = 0;
  double offset = 0, slope = 0, intercept = 0;
  std::array<double, 8> pixdim{};
  std::array<double, 6> quaternion{};  // b c d, then the offset x y z
  std::array<double, 12> srow{};
  std::size_t size = 0;
};

// Count, Code, Real: the types of dimensions, codes and real numbers, which differ between the versions.
// `at`: where dim, datatype, pixdim, scl_slope, qform_code, quatern_b and srow_x begin.
template <class Count, class Code, class Real>
Header parse(const char* raw, bool swap, const std::array<std::size_t, 7>& at) {
  Header h;
  h.swap = swap;
  const auto real = [&](std::size_t where, std::size_t i) {
    return static_cast<double>(load<Real>(raw + where + i * sizeof(Real), swap));
  };
  for (std::size_t i = 0; i < 8; ++i) h.dim[i] = load<Count>(raw + at[0] + i * sizeof(Count), swap);
  h.datatype = load<std::int16_t>(raw + at[1], swap);
  for (std::size_t i = 0; i < 8; ++i) h.pixdim[i] = real(at[2], i);
  h.slope = real(at[3], 0), h.intercept = real(at[3], 1);
  h.qform = load<Code>(raw + at[4], swap), h.sform = load<Code>(raw + at[4] + sizeof(Code), swap);
  for (std::size_t i = 0; i < 6; ++i) h.quaternion[i] = real(at[5], i);
  for (std::size_t i = 0; i < 12; ++i) h.srow[i] = real(at[6], i);
  return h;
}

Header read_header(Source& source, const std::string& name) {
  char raw[540] = {};
  if (source.read(raw, 348) < 348) throw Error(ErrorKind::format, "{}: too short for a NIfTI header", name);
  Header h;
  const auto size = load<std::int32_t>(raw, false), swapped = load<std::int32_t>(raw, true);
  if (size == 348 || swapped == 348) {
    h = parse<std::int16_t, std::int16_t, float>(raw, swapped == 348, {40, 70, 76, 112, 252, 256, 280});
    h.offset = load<float>(raw + 108, h.swap), h.units = raw[123], h.size = 348;
    if (std::memcmp(raw + 344, "ni1", 4) == 0)
      throw Error(ErrorKind::format,
                  "{}: its voxels are in a second file (.hdr and .img): save it as one .nii", name);
    if (std::memcmp(raw + 344, "n+1", 4) != 0)
      throw Error(ErrorKind::format, "{}: no NIfTI file (ANALYZE 7.5?)", name);
  } else if (size == 540 || swapped == 540) {
    if (source.read(raw + 348, 192) < 192)
      throw Error(ErrorKind::format, "{}: too short for a NIfTI-2 header", name);
    if (std::memcmp(raw + 4, "n+2\0\r\n\032\n", 8) != 0)
      throw Error(ErrorKind::format, "{}: no NIfTI-2 file, or damaged by a transfer as text", name);
    h = parse<std::int64_t, std::int32_t, double>(raw, swapped == 540, {16, 12, 104, 176, 344, 352, 400});
    h.offset = static_cast<double>(load<std::int64_t>(raw + 168, h.swap)), h.size = 540;
    h.units = load<std::int32_t>(raw + 500, h.swap);
  } else {
    throw Error(ErrorKind::format, "{}: no NIfTI file", name);
  }
  return h;
}

double metres(const Header& h) {
  switch (h.units & 7) {
    case 1:
      return 1;
    case 3:
      return 1e-6;
    default:
      return 1e-3;  // not stated: millimetres, as everybody takes it
  }
}

Mat3 rotation(const Header& h) {
  double b = h.quaternion[0], c = h.quaternion[1], d = h.quaternion[2];
  double a = 1 - (b * b + c * c + d * d);
  if (a < 1e-7) {  // rounded: a half turn
    const double norm = std::sqrt(b * b + c * c + d * d);
    b /= norm, c /= norm, d /= norm, a = 0;
  } else {
    a = std::sqrt(a);
  }
  return Eigen::Quaterniond(a, b, c, d).toRotationMatrix();
}

// sform before qform before voxel sizes alone.
Eigen::Matrix<double, 3, 4> to_world(const Header& h, const std::string& name) {
  Eigen::Matrix<double, 3, 4> m = Eigen::Matrix<double, 3, 4>::Zero();
  if (h.sform > 0) {
    for (int i = 0; i < 12; ++i) m(i / 4, i % 4) = h.srow[static_cast<std::size_t>(i)];
  } else {
    Vec3 size(std::abs(h.pixdim[1]), std::abs(h.pixdim[2]), std::abs(h.pixdim[3]));
    for (int i = 0; i < 3; ++i)  // dimensions that the file does not have
      if (i >= h.dim[0] && !(size[i] > 0)) size[i] = 1;
    if (h.qform > 0) {
      if (h.pixdim[0] < 0) size.z() = -size.z();
      m.leftCols<3>() = rotation(h) * size.asDiagonal();
      m.col(3) = Vec3(h.quaternion[3], h.quaternion[4], h.quaternion[5]);
    } else {
      m.leftCols<3>() = Mat3(size.asDiagonal());
    }
  }
  const Mat3 axes = m.leftCols<3>();
  const double lengths = axes.col(0).norm() * axes.col(1).norm() * axes.col(2).norm();
  if (!m.allFinite() || !(std::abs(axes.determinant()) > 1e-6 * lengths))
    throw Error(ErrorKind::format, "{}: the placement of its voxels ({}) is no placement", name,
                h.sform > 0   ? "sform"
                : h.qform > 0 ? "qform"
                              : "pixdim");
  return metres(h) * m;
}

// Voxels as the file has them, one type after the other, to labels.
struct Reader {
  Source& source;
  const Header& header;
  const std::string& name;
  LabelVolume& volume;

  [[noreturn]] void fail(std::size_t voxel, double value, const char* what) const {
    const auto& n = volume.size;
    throw Error(ErrorKind::format, "{}: voxel ({}, {}, {}) is {}: {}", name, voxel % n[0],
                voxel / n[0] % n[1], voxel / n[0] / n[1], value, what);
  }

  template <class T>
  void run(std::size_t count) {
    const bool scaled = std::isfinite(header.slope) && std::isfinite(header.intercept) && header.slope != 0 &&
                        (header.slope != 1 || header.intercept != 0);
    std::vector<char> chunk(std::min<std::size_t>(count, 1 << 18) * sizeof(T));
    for (std::size_t begin = 0; begin < count;) {
      const std::size_t n = std::min(count - begin, chunk.size() / sizeof(T));
      if (source.read(chunk.data(), n * sizeof(T)) < n * sizeof(T))
        throw Error(ErrorKind::format, "{}: holds fewer voxels than its {} x {} x {}: truncated", name,
                    volume.size[0], volume.size[1], volume.size[2]);
      for (std::size_t i = 0; i < n; ++i) {
        auto x = static_cast<double>(load<T>(chunk.data() + i * sizeof(T), header.swap));
        if (scaled) x = header.slope * x + header.intercept;
        if (x != std::floor(x)) fail(begin + i, x, "no whole number, so this is no label volume");
        if (!(std::abs(x) <= std::numeric_limits<std::int32_t>::max()))
          fail(begin + i, x, "too big for a label");
        volume.labels.push_back(static_cast<std::int32_t>(x));
      }
      begin += n;
    }
  }
};

struct VoxelType {
  int code;
  std::size_t bytes;
  void (Reader::*run)(std::size_t);
};
constexpr VoxelType voxel_types[] = {
    {2, 1, &Reader::run<std::uint8_t>},    {4, 2, &Reader::run<std::int16_t>},
    {8, 4, &Reader::run<std::int32_t>},    {16, 4, &Reader::run<float>},
    {64, 8, &Reader::run<double>},         {256, 1, &Reader::run<std::int8_t>},
    {512, 2, &Reader::run<std::uint16_t>}, {768, 4, &Reader::run<std::uint32_t>},
    {1024, 8, &Reader::run<std::int64_t>}, {1280, 8, &Reader::run<std::uint64_t>}};

std::array<std::size_t, 3> sizes(const Header& h, const std::string& name) {
  if (h.dim[0] < 1 || h.dim[0] > 7)
    throw Error(ErrorKind::format, "{}: says it has {} dimensions", name, h.dim[0]);
  std::array<std::size_t, 3> size{1, 1, 1};
  for (std::size_t i = 1; i <= static_cast<std::size_t>(h.dim[0]); ++i) {
    if (h.dim[i] < 1 || h.dim[i] > std::numeric_limits<std::int32_t>::max())
      throw Error(ErrorKind::format, "{}: says it is {} voxels long in dimension {}", name, h.dim[i], i);
    if (i <= 3)
      size[i - 1] = static_cast<std::size_t>(h.dim[i]);
    else if (h.dim[i] > 1)
      throw Error(ErrorKind::format, "{}: has {} volumes (dimension {}); save the one you want by itself",
                  name, h.dim[i], i);
  }
  return size;
}

}  // namespace

bool is_label_file(const std::filesystem::path& path) {
  const std::string name = path.filename().string();
  return name.ends_with(".nii") || name.ends_with(".nii.gz");
}

LabelVolume read_labels(const std::filesystem::path& path) {
  return parse_labels(read_file(path), path.string());
}

LabelVolume parse_labels(const std::string& bytes, const std::string& name) {
  if (bytes.empty()) throw Error(ErrorKind::format, "{}: the file is empty", name);
  Source source(bytes, name);
  const Header header = read_header(source, name);
  LabelVolume volume;
  volume.size = sizes(header, name);
  const auto type = std::find_if(std::begin(voxel_types), std::end(voxel_types),
                                 [&](const VoxelType& t) { return t.code == header.datatype; });
  if (type == std::end(voxel_types))
    throw Error(ErrorKind::format, "{}: voxels of NIfTI type {}; labels are whole numbers", name,
                header.datatype);
  volume.to_world = to_world(header, name);

  if (!(header.offset >= 0 && header.offset < 1e15) || header.offset != std::floor(header.offset))
    throw Error(ErrorKind::format, "{}: its voxels begin at byte {}", name, header.offset);
  // Extensions lie between header and voxels; an offset of 0 means right behind the header and its four
  // flags.
  auto skip =
      static_cast<std::uint64_t>(std::max(header.offset, static_cast<double>(header.size + 4))) - header.size;
  const double voxels = static_cast<double>(volume.size[0]) * static_cast<double>(volume.size[1]) *
                        static_cast<double>(volume.size[2]);
  if (voxels * static_cast<double>(type->bytes) + static_cast<double>(skip) >
      static_cast<double>(source.most()))
    throw Error(ErrorKind::format, "{}: too short for its {} x {} x {} voxels: truncated", name,
                volume.size[0], volume.size[1], volume.size[2]);
  const auto count = static_cast<std::size_t>(voxels);
  if (voxels * sizeof(std::int32_t) > static_cast<double>(available_bytes()))
    throw Error(ErrorKind::resource, "{}: {} voxels take more memory than is free", name, count);
  for (char waste[4096]; skip > 0;) {
    const std::size_t n = source.read(waste, std::min<std::uint64_t>(skip, sizeof waste));
    if (n == 0) throw Error(ErrorKind::format, "{}: ends before its voxels begin: truncated", name);
    skip -= n;
  }
  Reader reader{source, header, name, volume};
  if (!source.packed()) volume.labels.reserve(count);  // a gzip file may hold less than it could
  (reader.*type->run)(count);
  char rest[4096];  // to the end of the gzip data, where their checksum is
  for (int i = 0; i < 1024 && source.read(rest, sizeof rest) > 0; ++i) {
  }
  return volume;
}

}  // namespace palpate
