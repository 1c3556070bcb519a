#include "palpate/io/importer.hpp"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstring>

#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/io/import_protocol.hpp"
#include "palpate/io/surface_formats.hpp"

extern char** environ;

namespace palpate {

namespace fs = std::filesystem;
using namespace import_protocol;

namespace {

struct Pipe {
  int read = -1, write = -1;
  Pipe() {
    int fd[2];
    if (pipe2(fd, O_CLOEXEC) != 0)
      throw Error(ErrorKind::resource, "cannot open a pipe: {}", std::strerror(errno));
    read = fd[0], write = fd[1];
  }
  ~Pipe() {
    for (const int fd : {read, write})
      if (fd >= 0) close(fd);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
};

// A started program; killed and reaped where it was not waited for.
struct Child {
  pid_t pid = -1;
  ~Child() {
    if (pid < 0) return;
    kill(pid, SIGKILL);
    while (waitpid(pid, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
};

std::string find_program() {
  std::error_code error;
  const fs::path beside = fs::read_symlink("/proc/self/exe", error).parent_path() / "palpate-import";
  if (!error && access(beside.c_str(), X_OK) == 0) return beside;
  const char* named = std::getenv("PALPATE_IMPORT");
  return named && *named ? named : "palpate-import";
}

pid_t start(const std::string& file, const Pipe& out, const Pipe& err) {
  const std::string program = find_program();
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out.write, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, err.write, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, all;
  sigemptyset(&none), sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  std::string name = program, argument = file;
  char* arguments[] = {name.data(), argument.data(), nullptr};
  pid_t pid = -1;
  const int error = posix_spawnp(&pid, program.c_str(), &actions, &attributes, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (error)
    throw Error(
        ErrorKind::file,
        "{}: cannot be read: the program palpate-import cannot be started ({}); it belongs beside the "
        "running program, or set PALPATE_IMPORT to its path",
        file, std::strerror(error));
  return pid;
}

struct Output {
  std::string data, message;
};

// Everything the program writes, until it closes both pipes.
Output drain(const std::string& file, Pipe& out, Pipe& err, std::uint64_t most, const Timer& timer) {
  Output output;
  std::vector<char> buffer(1 << 20);
  std::array<pollfd, 2> fds{pollfd{out.read, POLLIN, 0}, pollfd{err.read, POLLIN, 0}};
  while (fds[0].fd >= 0 || fds[1].fd >= 0) {
    if (timer.seconds() > wall_seconds)
      throw Error(ErrorKind::format, "{}: not read after {} s; the file is damaged or too big", file,
                  wall_seconds);
    if (poll(fds.data(), fds.size(), 1000) < 0 && errno != EINTR)
      throw Error(ErrorKind::internal, "{}: poll: {}", file, std::strerror(errno));
    for (pollfd& fd : fds) {
      if (fd.fd < 0 || fd.revents == 0) continue;
      const ssize_t n = read(fd.fd, buffer.data(), buffer.size());
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) {
        fd.fd = -1;
        continue;
      }
      std::string& to = &fd == fds.data() ? output.data : output.message;
      to.append(buffer.data(), static_cast<std::size_t>(n));
      if (output.data.size() > most || output.message.size() > 1 << 16)
        throw Error(ErrorKind::resource, "{}: turns into more than {} MB of triangles", file, most >> 20);
      fd.revents = 0;
    }
  }
  return output;
}

int wait_for(const std::string& file, Child& child, const Timer& timer) {
  int status = 0;
  for (;;) {
    const pid_t pid = waitpid(child.pid, &status, WNOHANG);
    if (pid != 0 && !(pid < 0 && errno == EINTR)) {
      child.pid = -1;
      return pid < 0 ? 0 : status;  // reaped by somebody else: the data alone tell
    }
    if (timer.seconds() > wall_seconds)
      throw Error(ErrorKind::format, "{}: not read after {} s", file, wall_seconds);
    usleep(500);
  }
}

[[noreturn]] void explain(const std::string& file, const std::string& format, int status,
                          std::string message) {
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    if (signal == SIGINT || signal == SIGTERM)
      throw Error(ErrorKind::interrupted, "interrupted; nothing was written");
    if (signal == SIGXCPU)
      throw Error(ErrorKind::format,
                  "{}: the {} reader was stopped after {} s; the file is damaged or too big", file, format,
                  cpu_seconds);
    if (signal == SIGKILL)
      throw Error(ErrorKind::resource, "{}: the {} reader was killed, for lack of memory it seems", file,
                  format);
    std::string how = strsignal(signal);
    how[0] = static_cast<char>(std::tolower(how[0]));
    throw Error(
        ErrorKind::format,
        "{}: the {} reader died on it ({}); the file is damaged: export it again, or in another format", file,
        format, how);
  }
  const int code = WEXITSTATUS(status);
  if (!message.empty() && message.back() == '\n') message.pop_back();
  std::replace(message.begin(), message.end(), '\n', ' ');
  throw Error(code == unreadable  ? ErrorKind::file
              : code == malformed ? ErrorKind::format
              : code == too_big   ? ErrorKind::resource
                                  : ErrorKind::internal,
              "{}: {}", file, message.empty() ? fmt::format("palpate-import ended with {}", code) : message);
}

TriangleMesh unpack(const std::string& file, const std::string& data) {
  Counts counts{};
  if (data.size() >= sizeof(Hello) + sizeof counts)
    std::memcpy(&counts, data.data() + sizeof(Hello), sizeof counts);
  const std::uint64_t payload = data.size() - std::min(data.size(), sizeof(Hello) + sizeof counts);
  if (counts.vertices > payload / 12 || counts.triangles > payload / 12 ||
      (counts.vertices + counts.triangles) * 12 != payload || data.size() < sizeof(Hello) + sizeof counts)
    throw Error(ErrorKind::internal, "{}: palpate-import of another version? its answer has {} bytes", file,
                data.size());
  if (counts.vertices > static_cast<std::uint64_t>(std::numeric_limits<Index>::max()))
    throw Error(ErrorKind::resource, "{}: {} vertices are too many", file, counts.vertices);
  TriangleMesh mesh;
  mesh.vertices.resize(counts.vertices), mesh.triangles.resize(counts.triangles);
  const char* p = data.data() + sizeof(Hello) + sizeof counts;
  for (Vec3& v : mesh.vertices) {
    Vec3f f;
    std::memcpy(f.data(), p, 12);
    v = f.cast<double>(), p += 12;
  }
  for (Triangle& t : mesh.triangles) std::memcpy(t.data(), p, 12), p += 12;
  return mesh;
}

}  // namespace

Imported import_surface(const fs::path& path) {
  const std::string file = path.string();
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) throw Error(ErrorKind::file, "{}: {}", file, error.message());
  const Timer timer = wall_timer();
  Pipe out, err;
  Child child;
  // A name that begins with a dash is no option.
  child.pid = start(file[0] == '-' ? "./" + file : file, out, err);
  for (Pipe* pipe : {&out, &err}) close(std::exchange(pipe->write, -1));
  const Output output = drain(file, out, err, memory_bytes(size), timer);
  const int status = wait_for(file, child, timer);

  Hello hello{};
  if (output.data.size() >= sizeof hello) std::memcpy(&hello, output.data.data(), sizeof hello);
  hello.format[sizeof hello.format - 1] = 0;
  const bool known = std::memcmp(hello.magic, magic, sizeof magic) == 0;
  Imported imported;
  imported.format = known ? hello.format : "surface";
  if (status != 0) explain(file, imported.format, status, output.message);
  if (!known) throw Error(ErrorKind::internal, "{}: palpate-import gave no answer", file);
  imported.mesh = unpack(file, output.data);
  require_polygons(imported.mesh, file, imported.format);
  return imported;
}

}  // namespace palpate
