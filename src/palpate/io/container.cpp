// libhdf5 keeps the structure (groups, names, shapes, attributes); the arrays themselves are read and written
// here, at the offsets it gives: straight from and to the caller's memory, with the system's reason where
// that fails.
#include "palpate/io/container.hpp"

#include <fcntl.h>
#include <hdf5.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <mutex>
#include <variant>

#include "palpate/base/error.hpp"
#include "palpate/base/hash.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/io/seal.hpp"

namespace palpate {

namespace {

constexpr std::size_t slab = 1 << 20;  // bytes read or written at once: stays in the cache for the hash
// libhdf5 is one global state, and talks on stderr unless told not to.
class Hdf5 {
 public:
  Hdf5() : lock_(mutex()) {
    // At exit libhdf5 would close what could not be closed before, and crash. Before any other call.
    [[maybe_unused]] static const bool once = H5dont_atexit() >= 0;
    H5Eget_auto2(H5E_DEFAULT, &handler_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Hdf5() { H5Eset_auto2(H5E_DEFAULT, handler_, data_); }
  Hdf5(const Hdf5&) = delete;
  Hdf5& operator=(const Hdf5&) = delete;

 private:
  static std::mutex& mutex() {
    static std::mutex m;
    return m;
  }
  std::lock_guard<std::mutex> lock_;
  H5E_auto2_t handler_ = nullptr;
  void* data_ = nullptr;
};

// An HDF5 identifier, closed by its own function. The lock must be held.
class Id {
 public:
  Id(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Id() {
    if (id_ >= 0) close_(id_);
  }
  Id(Id&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Id& operator=(Id&& other) noexcept {
    std::swap(id_, other.id_), std::swap(close_, other.close_);
    return *this;
  }
  operator hid_t() const { return id_; }
  bool ok() const { return id_ >= 0; }
  void release() { id_ = -1; }  // closed already

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

// The number of a type of ours, and how it is stored.
template <class T>
constexpr int type_number() {
  if constexpr (std::is_same_v<T, float>) return 0;
  if constexpr (std::is_same_v<T, double>) return 1;
  if constexpr (std::is_same_v<T, std::int32_t>) return 2;
  if constexpr (std::is_same_v<T, std::int64_t>) return 3;
  if constexpr (std::is_same_v<T, std::uint8_t>) return 4;
  if constexpr (std::is_same_v<T, std::uint16_t>) return 5;
}
// float16, as h5py and others spell it; HDF5 1.10 has no name for it. Kept until the program ends.
hid_t make_half() {
  const hid_t half = H5Tcopy(H5T_IEEE_F32LE);
  H5Tset_fields(half, 15, 10, 5, 0, 10);
  H5Tset_size(half, 2);
  H5Tset_ebias(half, 15);
  return half;
}
hid_t stored_type(int number) {
  static const hid_t half = make_half();
  const hid_t types[] = {H5T_IEEE_F32LE, H5T_IEEE_F64LE, H5T_STD_I32LE, H5T_STD_I64LE, H5T_STD_U8LE, half};
  return types[number];
}

Id string_type() {
  Id type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, H5T_VARIABLE);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

std::string system_reason() { return errno ? std::strerror(errno) : "the file ends early"; }

Id open_hdf5(const char* path, unsigned flags) {
  const Id access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_file_locking(access, false, true);
  return {H5Fopen(path, flags, access), H5Fclose};
}

// A file without contents, made in memory: where libhdf5 cannot write the first bytes of a new file it stays
// broken until the program ends, and then hangs or crashes.
std::string empty_file() {
  const Id access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_fapl_core(access, 1 << 12, false);
  const Id file(H5Fcreate("empty", H5F_ACC_TRUNC, H5P_DEFAULT, access), H5Fclose);
  H5Fflush(file, H5F_SCOPE_LOCAL);
  std::string bytes(static_cast<std::size_t>(std::max<ssize_t>(H5Fget_file_image(file, nullptr, 0), 0)),
                    '\0');
  H5Fget_file_image(file, bytes.data(), bytes.size());
  return bytes;
}

bool starts_as_hdf5(int fd) {
  char start[8] = {};
  return read_at(fd, start, 8, 0) && std::memcmp(start, "\x89HDF\r\n\x1a\n", 8) == 0;
}

int open_for_reading(const std::filesystem::path& path) {
  errno = 0;
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) throw Error(ErrorKind::file, "{}: cannot be read: {}", path.string(), system_reason());
  struct stat status;
  if (fstat(fd, &status) == 0 && S_ISREG(status.st_mode)) return fd;
  ::close(fd);
  throw Error(ErrorKind::file, "{}: is not a regular file", path.string());
}

}  // namespace

struct ContainerWriter::Impl {
  explicit Impl(const std::filesystem::path& target) : path(target.string()), output(target) {}
  // What is still unwritten goes to memory: with a full disk libhdf5 could never let go of the file.
  ~Impl() {
    if (!file.ok()) return;
    const Hdf5 lock;
    const int memory = memfd_create("palpate", MFD_CLOEXEC);
    if (memory >= 0 && fd >= 0) dup2(memory, fd);
    if (memory >= 0) ::close(memory);
    file = Id(-1, H5Fclose);
  }

  [[noreturn]] void fail() const {
    throw Error(ErrorKind::file, "{}: cannot be written: {}", path,
                errno ? std::strerror(errno) : "HDF5 gives no reason");
  }
  void check(bool ok) const {
    if (!ok) fail();
  }
  void attribute(hid_t object, const std::string& name, hid_t type, const void* value) {
    const Id space(H5Screate(H5S_SCALAR), H5Sclose);
    const Id id(H5Acreate2(object, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    check(id.ok() && H5Awrite(id, type, value) >= 0);
  }
  void attribute(hid_t object, const std::string& name, const std::string& text) {
    const char* const c = text.c_str();
    attribute(object, name, string_type(), &c);
  }

  std::string path;
  AtomicFile output;
  Id file{-1, H5Fclose};
  int fd = -1;  // of `file`
  std::vector<Range> ranges;
};

ContainerWriter::ContainerWriter(const std::filesystem::path& path, const std::string& kind, int version)
    : impl_(std::make_unique<Impl>(path)) {
  {
    const Hdf5 lock;
    errno = 0;
    const char* const name = impl_->output.temporary().c_str();
    {
      const Descriptor out(::open(name, O_WRONLY | O_CLOEXEC));
      const std::string empty = empty_file();
      impl_->check(out.fd >= 0 && write_at(out.fd, empty.data(), empty.size(), 0));
    }
    impl_->file = open_hdf5(name, H5F_ACC_RDWR);
    void* handle = nullptr;
    impl_->check(impl_->file.ok() && H5Fget_vfd_handle(impl_->file, H5P_DEFAULT, &handle) >= 0);
    impl_->fd = *static_cast<int*>(handle);
  }
  attribute("palpate_kind", kind);
  attribute("palpate_version", std::int64_t{version});
}

ContainerWriter::~ContainerWriter() = default;

void ContainerWriter::attribute(const std::string& name, const std::string& value) {
  const Hdf5 lock;
  impl_->attribute(impl_->file, name, value);
}
void ContainerWriter::attribute(const std::string& name, double value) {
  const Hdf5 lock;
  impl_->attribute(impl_->file, name, H5T_IEEE_F64LE, &value);
}
void ContainerWriter::attribute(const std::string& name, std::int64_t value) {
  const Hdf5 lock;
  impl_->attribute(impl_->file, name, H5T_STD_I64LE, &value);
}

template <class T>
void ContainerWriter::array(const std::string& name, std::span<const T> values,
                            std::vector<std::size_t> shape, const std::string& unit,
                            const std::string& meaning, const Progress& progress) {
  std::size_t n = 1;
  for (const std::size_t s : shape) n *= s;
  if (n != values.size())
    throw Error(ErrorKind::internal, "{}: {}: {} values for a shape of {}", impl_->path, name, values.size(),
                n);
  const std::vector<hsize_t> dims(shape.begin(), shape.end());
  const Hdf5 lock;
  errno = 0;
  const Id space(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr), H5Sclose);
  const Id link(H5Pcreate(H5P_LINK_CREATE), H5Pclose), create(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(link, 1);
  H5Pset_layout(create, H5D_CONTIGUOUS);
  H5Pset_alloc_time(create, H5D_ALLOC_TIME_EARLY);
  H5Pset_fill_time(create, H5D_FILL_TIME_NEVER);
  H5Pset_obj_track_times(create, false);  // the same contents give the same bytes
  const Id set(
      H5Dcreate2(impl_->file, name.c_str(), stored_type(type_number<T>()), space, link, create, H5P_DEFAULT),
      H5Dclose);
  impl_->check(set.ok());
  Hash hash;
  if (n > 0) {
    impl_->ranges.push_back({H5Dget_offset(set), values.size_bytes()});
    const auto* bytes = reinterpret_cast<const char*>(values.data());
    for (std::size_t at = 0; at < values.size_bytes(); at += slab) {
      const std::size_t size = std::min(slab, values.size_bytes() - at);
      hash.add_bytes(bytes + at, size);
      impl_->check(write_at(impl_->fd, bytes + at, size, impl_->ranges.back().offset + at));
      progress.at(static_cast<double>(at + size) / static_cast<double>(values.size_bytes()));
    }
  }
  impl_->attribute(set, "unit", unit);
  impl_->attribute(set, "meaning", meaning);
  impl_->attribute(set, "checksum", fmt::format("{:016x}", hash.value()));
}

void ContainerWriter::commit() {
  {
    const Hdf5 lock;
    errno = 0;
    impl_->check(H5Fflush(impl_->file, H5F_SCOPE_LOCAL) >= 0);
    impl_->check(H5Fclose(impl_->file) >= 0);
    impl_->file.release();
  }
  errno = 0;
  const Descriptor file(::open(impl_->output.temporary().c_str(), O_RDWR | O_CLOEXEC));
  impl_->check(file.fd >= 0 && write_seal(file.fd, std::move(impl_->ranges)));
  impl_->output.commit();
}

struct ContainerReader::Impl {
  struct Array {
    int type = -1;  // type_number
    std::uint64_t offset = 0;
    std::vector<std::size_t> shape;
    std::size_t size = 0;  // values
    std::string checksum;
  };

  std::string path;
  Descriptor file;
  std::map<std::string, std::variant<std::string, double, std::int64_t>> attributes;
  std::map<std::string, Array> arrays;

  explicit Impl(const std::filesystem::path& p) : path(p.string()), file{open_for_reading(p)} {}
  [[noreturn]] void damaged(const std::string& what) const {
    throw Error(ErrorKind::format, "{}: {}; the file is damaged, make it again", path, what);
  }
  void load();
  void load_attributes(hid_t root);
  void load_array(hid_t root, const std::string& name);

  const Array& find(const std::string& name) const {
    const auto found = arrays.find(name);
    if (found == arrays.end()) throw Error(ErrorKind::format, "{}: has no array {}", path, name);
    return found->second;
  }
  template <class T>
  const T& find_attribute(const std::string& name, const char* type) const {
    const auto found = attributes.find(name);
    if (found == attributes.end()) throw Error(ErrorKind::format, "{}: has no attribute {}", path, name);
    if (const T* value = std::get_if<T>(&found->second)) return *value;
    throw Error(ErrorKind::format, "{}: attribute {} is no {}", path, name, type);
  }
};

namespace {

extern "C" herr_t collect_attribute(hid_t, const char* name, const H5A_info_t*, void* names) {
  static_cast<std::vector<std::string>*>(names)->push_back(name);
  return 0;
}

extern "C" herr_t collect_link(hid_t, const char* name, const H5L_info_t*, void* names) {
  static_cast<std::vector<std::string>*>(names)->push_back(name);
  return 0;
}

std::string read_string(const Id& attribute) {
  char* text = nullptr;
  const Id type = string_type();
  if (H5Aread(attribute, type, &text) < 0 || !text) return {};
  const std::string copy = text;
  H5free_memory(text);
  return copy;
}

}  // namespace

void ContainerReader::Impl::load_attributes(hid_t root) {
  std::vector<std::string> names;
  H5Aiterate2(root, H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, collect_attribute, &names);
  for (const std::string& name : names) {
    const Id id(H5Aopen(root, name.c_str(), H5P_DEFAULT), H5Aclose);
    const Id type(H5Aget_type(id), H5Tclose), space(H5Aget_space(id), H5Sclose);
    if (!type.ok() || H5Sget_simple_extent_type(space) != H5S_SCALAR) continue;
    double number = 0;
    std::int64_t integer = 0;
    if (H5Tis_variable_str(type) > 0)
      attributes[name] = read_string(id);
    else if (H5Tget_class(type) == H5T_INTEGER && H5Aread(id, H5T_NATIVE_INT64, &integer) >= 0)
      attributes[name] = integer;
    else if (H5Tget_class(type) == H5T_FLOAT && H5Aread(id, H5T_NATIVE_DOUBLE, &number) >= 0)
      attributes[name] = number;
  }
}

void ContainerReader::Impl::load_array(hid_t root, const std::string& name) {
  const Id set(H5Dopen2(root, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!set.ok()) return;  // a group
  const Id type(H5Dget_type(set), H5Tclose), space(H5Dget_space(set), H5Sclose);
  const int rank = H5Sget_simple_extent_ndims(space);
  const Id checksum(H5Aopen(set, "checksum", H5P_DEFAULT), H5Aclose);
  Array array;
  for (int t = 0; t < 6; ++t)
    if (H5Tequal(type, stored_type(t)) > 0) array.type = t;
  if (rank < 0 || !checksum.ok() || array.type < 0) damaged("array " + name + " is none of ours");
  std::vector<hsize_t> dims(static_cast<std::size_t>(rank));
  H5Sget_simple_extent_dims(space, dims.data(), nullptr);
  array.shape.assign(dims.begin(), dims.end());
  array.checksum = read_string(checksum);
  const std::uint64_t total = file_size(file.fd), width = H5Tget_size(type);
  std::uint64_t bytes = width;
  for (const hsize_t d : dims) {
    if (d > 0 && bytes > total / d) damaged("array " + name + " is larger than the file");
    bytes *= d;
  }
  array.size = static_cast<std::size_t>(bytes / width);
  if (bytes > 0) {
    array.offset = H5Dget_offset(set);  // all ones where it is not contiguous
    if (array.offset > total || bytes > total - array.offset)
      damaged("array " + name + " ends beyond the file");
  }
  arrays[name] = std::move(array);
}

void ContainerReader::Impl::load() {
  if (!starts_as_hdf5(file.fd)) throw Error(ErrorKind::format, "{}: is no palpate container (HDF5)", path);
  if (!sealed_whole(file.fd))
    throw Error(ErrorKind::format,
                "{}: is truncated or damaged, or was written or changed by another program; make it again",
                path);
  const Hdf5 lock;
  const Id root = open_hdf5(path.c_str(), H5F_ACC_RDONLY);
  if (!root.ok()) damaged("HDF5 cannot open it");
  load_attributes(root);
  std::vector<std::string> names;
  H5Lvisit(root, H5_INDEX_NAME, H5_ITER_NATIVE, collect_link, &names);
  for (const std::string& name : names) load_array(root, name);
}

ContainerReader::ContainerReader(const std::filesystem::path& path, const std::string& kind, int version)
    : impl_(std::make_unique<Impl>(path)) {
  impl_->load();
  const std::string found = text("palpate_kind");
  if (found != kind) throw Error(ErrorKind::format, "{}: holds a {}, not a {}", impl_->path, found, kind);
  if (this->version() > version)
    throw Error(ErrorKind::format, "{}: is of version {}, newer than the {} this program reads; update it",
                impl_->path, this->version(), version);
}

ContainerReader::~ContainerReader() = default;

int ContainerReader::version() const { return static_cast<int>(integer("palpate_version")); }
bool ContainerReader::has(const std::string& name) const { return impl_->arrays.count(name) > 0; }
bool ContainerReader::has_attribute(const std::string& name) const {
  return impl_->attributes.count(name) > 0;
}

std::string ContainerReader::text(const std::string& attribute) const {
  return impl_->find_attribute<std::string>(attribute, "text");
}
double ContainerReader::number(const std::string& attribute) const {
  const auto found = impl_->attributes.find(attribute);
  if (found != impl_->attributes.end())
    if (const auto* whole = std::get_if<std::int64_t>(&found->second)) return static_cast<double>(*whole);
  return impl_->find_attribute<double>(attribute, "number");
}
std::int64_t ContainerReader::integer(const std::string& attribute) const {
  return impl_->find_attribute<std::int64_t>(attribute, "whole number");
}

std::vector<std::size_t> ContainerReader::shape(const std::string& name) const {
  return impl_->find(name).shape;
}

template <class T>
void ContainerReader::array(const std::string& name, std::span<T> out, bool verify,
                            const Progress& progress) const {
  const Impl::Array& array = impl_->find(name);
  if (array.type != type_number<T>())
    throw Error(ErrorKind::format, "{}: array {} holds another type of numbers than expected", impl_->path,
                name);
  if (array.size != out.size())
    throw Error(ErrorKind::format, "{}: array {} holds {} numbers where {} are expected", impl_->path, name,
                array.size, out.size());
  Hash hash;
  auto* bytes = reinterpret_cast<char*>(out.data());
  for (std::size_t at = 0; at < out.size_bytes(); at += slab) {
    const std::size_t size = std::min(slab, out.size_bytes() - at);
    if (!read_at(impl_->file.fd, bytes + at, size, array.offset + at)) {
      if (errno == 0) impl_->damaged("array " + name + " ends early");
      throw Error(ErrorKind::file, "{}: cannot be read: {}", impl_->path, std::strerror(errno));
    }
    if (verify) hash.add_bytes(bytes + at, size);
    progress.at(static_cast<double>(at + size) / static_cast<double>(out.size_bytes()));
  }
  if (verify && fmt::format("{:016x}", hash.value()) != array.checksum)
    impl_->damaged("the checksum of array " + name + " differs");
}

std::string container_kind(const std::filesystem::path& path) {
  ContainerReader::Impl impl(path);
  if (!starts_as_hdf5(impl.file.fd)) return {};
  impl.load();
  return impl.find_attribute<std::string>("palpate_kind", "text");
}

#define PALPATE_CONTAINER(T)                                                                                \
  template void ContainerWriter::array<T>(const std::string&, std::span<const T>, std::vector<std::size_t>, \
                                          const std::string&, const std::string&, const Progress&);         \
  template void ContainerReader::array<T>(const std::string&, std::span<T>, bool, const Progress&) const;
PALPATE_CONTAINER(float)
PALPATE_CONTAINER(double)
PALPATE_CONTAINER(std::int32_t)
PALPATE_CONTAINER(std::int64_t)
PALPATE_CONTAINER(std::uint8_t)
PALPATE_CONTAINER(std::uint16_t)
#undef PALPATE_CONTAINER

}  // namespace palpate
