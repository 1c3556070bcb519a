// palpate-import FILE: the triangles of a surface file to standard output (io/import_protocol.hpp), or one
// line on standard error. A program of its own because Coin and Assimp die on some damaged files. Its caller
// is palpate::import_surface.
#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <new>
#include <string_view>

#include "readers.hpp"

namespace palpate::import {
namespace {

using namespace import_protocol;

void limit(int resource, rlim_t most) {
  rlimit current{};
  getrlimit(static_cast<__rlimit_resource>(resource), &current);
  current.rlim_cur = std::min(most, current.rlim_max);
  setrlimit(static_cast<__rlimit_resource>(resource), &current);
}

// The first bytes of the file; sets the limits by its size.
std::string head_of(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct stat status {};
  if (file < 0 || fstat(file, &status) != 0) throw Failure(unreadable, std::strerror(errno));
  if (S_ISDIR(status.st_mode)) throw Failure(unreadable, "is a folder; give a file");
  if (!S_ISREG(status.st_mode)) throw Failure(unreadable, "is not a regular file");
  if (status.st_size == 0) throw Failure(malformed, "the file is empty");
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, cpu_seconds);
  limit(RLIMIT_AS, memory_bytes(static_cast<std::uint64_t>(status.st_size)));
  std::string head(512, '\0');
  const ssize_t n = read(file, head.data(), head.size());
  if (n < 0) throw Failure(unreadable, std::strerror(errno));
  close(file);
  head.resize(static_cast<std::size_t>(n));
  return head;
}

std::string lower_extension(const std::string& path) {
  const std::size_t dot = path.rfind('.');
  if (dot == std::string::npos || path.find('/', dot) != std::string::npos) return "";
  std::string e = path.substr(dot + 1);
  for (char& c : e)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return e;
}

bool starts_with(std::string_view text, std::string_view start) {
  return text.substr(0, start.size()) == start;
}

// Content first, extension second.
bool is_inventor(const std::string& path, const std::string& head) {
  const std::string extension = lower_extension(path);
  if (starts_with(head, "#Inventor V") || starts_with(head, "#VRML V")) return true;
  if (starts_with(head, "glTF")) return false;
  if (extension == "iv" || extension == "wrl") return true;
  if (extension == "glb" || extension == "gltf") return false;
  throw Failure(malformed, "neither Open Inventor, VRML nor glTF");
}

void write_all(int out, const void* data, std::size_t size) {
  const char* p = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t n = write(out, p, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) _exit(failed);  // nobody listens
    p += n, size -= static_cast<std::size_t>(n);
  }
}

void run(const std::string& path, int out) {
  const bool inventor = is_inventor(path, head_of(path));
  Hello hello{};
  std::memcpy(hello.magic, magic, sizeof magic);
  std::strncpy(hello.format, inventor ? "Open Inventor" : "glTF", sizeof hello.format - 1);
  write_all(out, &hello, sizeof hello);
  const Soup soup = inventor ? read_inventor(path) : read_gltf(path);
  const Counts counts{soup.vertices.size(), soup.triangles.size()};
  write_all(out, &counts, sizeof counts);
  write_all(out, soup.vertices.data(), soup.vertices.size() * sizeof soup.vertices[0]);
  write_all(out, soup.triangles.data(), soup.triangles.size() * sizeof soup.triangles[0]);
}

int fail(int err, int code, std::string reason) {
  std::replace_if(
      reason.begin(), reason.end(), [](char c) { return c == '\n' || c == '\r' || c == '\t'; }, ' ');
  reason += '\n';
  write_all(err, reason.data(), reason.size());
  return code;
}

}  // namespace
}  // namespace palpate::import

// Leaves by _exit: the libraries' own clean-up has nothing to give and may crash after a damaged file.
int main(int argc, char** argv) {
  using namespace palpate::import;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  // What the libraries print goes nowhere: standard output and error carry our data and our line alone.
  const int out = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3), err = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3);
  const int null = open("/dev/null", O_RDWR | O_CLOEXEC);
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) dup2(null, fd);
  if (argc != 2) _exit(fail(err, 2, "usage: palpate-import FILE"));
  try {
    run(argv[1], out);
    _exit(0);
  } catch (const Failure& e) {
    _exit(fail(err, e.code, e.what()));
  } catch (const std::bad_alloc&) {
    _exit(fail(err, too_big, "reading it takes more memory than a file of its size may"));
  } catch (const std::exception& e) {
    _exit(fail(err, malformed, e.what()));
  }
}
