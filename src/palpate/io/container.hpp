// The HDF5 container of lattices and models: named arrays with unit and meaning, attributes, a checksum over
// each array, a seal over the rest (seal.hpp). Readable with h5py, MATLAB and h5dump. Layout: the root's
// attributes say palpate_kind, palpate_version and whatever the writer adds; each array is a contiguous
// little-endian dataset with attributes unit, meaning and checksum (base/hash.hpp over its bytes, 16
// hexadecimal digits). The same contents give the same bytes. Any thread may use its own reader or writer; a
// reader may be shared.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "palpate/base/huge_array.hpp"
#include "palpate/base/progress.hpp"

namespace palpate {

class ContainerWriter {
 public:
  // kind: "lattice", "model". Written to a temporary name until commit().
  ContainerWriter(const std::filesystem::path& path, const std::string& kind, int version);
  ~ContainerWriter();
  void attribute(const std::string& name, const std::string& value);
  void attribute(const std::string& name, double value);
  void attribute(const std::string& name, std::int64_t value);
  // T: float, double, std::int32_t, std::int64_t, std::uint8_t; std::uint16_t: the bits of a float16. shape
  // multiplies to values.size(). `name` may hold '/': groups.
  template <class T>
  void array(const std::string& name, std::span<const T> values, std::vector<std::size_t> shape,
             const std::string& unit, const std::string& meaning, const Progress& progress = {});
  void commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

class ContainerReader {
 public:
  // Throws Error(file) or Error(format): not HDF5, other kind, newer version than `version`, truncated.
  ContainerReader(const std::filesystem::path& path, const std::string& kind, int version);
  ~ContainerReader();
  int version() const;
  bool has(const std::string& name) const;
  bool has_attribute(const std::string& name) const;
  std::string text(const std::string& attribute) const;  // these three throw Error(format) when missing
  double number(const std::string& attribute) const;
  std::int64_t integer(const std::string& attribute) const;
  std::vector<std::size_t> shape(const std::string& name) const;
  // Reads straight into `out`, whose size must match; verify compares the checksum. Error(format) where
  // something is off.
  template <class T>
  void array(const std::string& name, std::span<T> out, bool verify = true,
             const Progress& progress = {}) const;
  template <class T>
  std::vector<T> vector(const std::string& name) const {
    std::size_t n = 1;
    for (const std::size_t s : shape(name)) n *= s;
    std::vector<T> out(n);
    array<T>(name, out);
    return out;
  }

 private:
  friend std::string container_kind(const std::filesystem::path& path);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// "lattice", "model"; "" when the file is not HDF5. Error(format) when it is, but not a whole file of ours.
std::string container_kind(const std::filesystem::path& path);

}  // namespace palpate
