#include "palpate/base/timer.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>

namespace palpate {

namespace {
// The number after `key` in /proc/meminfo, in bytes; 0 where there is none.
std::size_t meminfo(const std::string& key) {
  std::ifstream in("/proc/meminfo");
  std::string word;
  std::size_t kib = 0;
  while (in >> word)
    if (word == key && in >> kib) return kib * 1024;
  return 0;
}
}  // namespace

std::size_t resident_bytes() {
  std::ifstream in("/proc/self/statm");
  std::size_t size = 0, resident = 0;
  in >> size >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

std::size_t peak_resident_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::size_t>(usage.ru_maxrss) * 1024;
}

std::size_t available_bytes() {
  std::size_t available = meminfo("MemAvailable:");
  if (available == 0) available = std::numeric_limits<std::size_t>::max();
  std::ifstream limit("/sys/fs/cgroup/memory.max"), used("/sys/fs/cgroup/memory.current");
  std::size_t most = 0, now = 0;
  if (limit >> most && used >> now) available = std::min(available, most > now ? most - now : 0);
  return available;
}

}  // namespace palpate
