// Output that is either there whole or not at all: written to a temporary name beside the target, then
// renamed.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace palpate {

// Throws Error(file) that names the path and the system's reason (missing folder, no permission, disk full).
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path target);
  ~AtomicFile();  // removes the temporary unless committed
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::filesystem::path& temporary() const {
    return temporary_;
  }                                    // for libraries that open files themselves
  void write(std::string_view bytes);  // appends
  void commit();                       // flush, check, rename

 private:
  std::filesystem::path target_, temporary_;
  std::ofstream out_;
  bool committed_ = false;
};

// Whole file as bytes; Error(file) when missing or unreadable, or when it is a folder.
std::string read_file(const std::filesystem::path& path);

}  // namespace palpate
