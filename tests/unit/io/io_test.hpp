// What the tests of files share: a folder that goes away, the kind of an error, a full disk.
#pragma once

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>

#include "palpate/base/error.hpp"

namespace palpate {

struct TempFolder {
  std::filesystem::path path;

  TempFolder() {
    // In memory where there is such a place: thousands of small files overwritten on a busy disk take
    // minutes.
    const bool memory = !std::getenv("TMPDIR") && std::filesystem::is_directory("/dev/shm");
    std::string name = (memory ? std::filesystem::path("/dev/shm") : std::filesystem::temp_directory_path()) /
                       "palpate-XXXXXX";
    if (!mkdtemp(name.data())) throw std::runtime_error("no temporary folder");
    path = name;
  }
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path / name; }
  void write(const std::string& name, const std::string& bytes) const {
    std::ofstream(path / name, std::ios::binary) << bytes;
  }
  std::size_t files() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(path), std::filesystem::directory_iterator()));
  }
};

// The kind of what f throws; ErrorKind{} (0, no kind) when it returns.
template <class F>
ErrorKind kind_of(F&& f) {
  try {
    f();
  } catch (const Error& error) {
    return error.kind();
  }
  return ErrorKind{};
}

// Files of this process cannot grow beyond `bytes`: writes fail as on a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(std::size_t bytes) : signal_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, signal_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_;
  void (*signal_)(int);
};

// A file of the kept test data (PALPATE_DATA, or beside the sources); empty when it is not there.
inline std::filesystem::path kept_data(const std::string& name) {
  const char* folder = std::getenv("PALPATE_DATA");
  const std::filesystem::path path = (folder ? std::filesystem::path(folder)
                                             : std::filesystem::path(PALPATE_SOURCE_DIR) / "../shared/data") /
                                     name;
  return std::filesystem::exists(path) ? path : std::filesystem::path();
}

}  // namespace palpate
