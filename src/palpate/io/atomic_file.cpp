#include "palpate/io/atomic_file.hpp"

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>

#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"

namespace palpate {

namespace fs = std::filesystem;

namespace {

std::string reason() { return errno ? std::strerror(errno) : "the system gives no reason"; }

[[noreturn]] void fail(const fs::path& target) {
  throw Error(ErrorKind::file, "{}: cannot be written: {}", target.string(), reason());
}

}  // namespace

AtomicFile::AtomicFile(fs::path target) : target_(std::move(target)) {
  std::error_code ignored;
  // What a link points to is replaced, not the link; it may point to a file that is not there yet.
  for (int i = 0; i < 40 && fs::is_symlink(target_, ignored); ++i)
    target_ = target_.parent_path() / fs::read_symlink(target_, ignored);
  const fs::file_status status = fs::status(target_, ignored);
  if (fs::is_directory(status))
    throw Error(ErrorKind::file, "{}: is a folder; give a file name", target_.string());
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    temporary_ = target_;  // a pipe or /dev/null cannot be replaced
  } else {
    static std::atomic<unsigned> count{0};
    temporary_ = target_.parent_path() /
                 fmt::format(".{}.{}-{}.part", target_.filename().string(), getpid(), count.fetch_add(1));
  }
  errno = 0;
  out_.open(temporary_, std::ios::binary | std::ios::trunc);
  if (!out_) fail(target_);
}

AtomicFile::~AtomicFile() {
  if (committed_ || temporary_ == target_) return;
  out_.close();
  std::error_code ignored;
  fs::remove(temporary_, ignored);
}

void AtomicFile::write(std::string_view bytes) {
  errno = 0;
  if (!out_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()))) fail(target_);
}

void AtomicFile::commit() {
  errno = 0;
  out_.close();
  if (!out_) fail(target_);
  if (temporary_ != target_ && std::rename(temporary_.c_str(), target_.c_str()) != 0) fail(target_);
  committed_ = true;
}

std::string read_file(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status))
    throw Error(ErrorKind::file, "{}: {}", path.string(), error ? error.message() : "no such file");
  if (fs::is_directory(status)) throw Error(ErrorKind::file, "{}: is a folder; give a file", path.string());
  if (!fs::is_regular_file(status)) throw Error(ErrorKind::file, "{}: is not a regular file", path.string());
  errno = 0;
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error(ErrorKind::file, "{}: cannot be read: {}", path.string(), reason());
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) throw Error(ErrorKind::file, "{}: cannot be read: {}", path.string(), error.message());
  if (size > available_bytes())
    throw Error(ErrorKind::resource, "{}: {} bytes, more than the memory that is free", path.string(), size);
  std::string bytes(size, '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(size));
  if (in.bad()) throw Error(ErrorKind::file, "{}: cannot be read: {}", path.string(), reason());
  bytes.resize(static_cast<std::size_t>(in.gcount()));
  return bytes;
}

}  // namespace palpate
