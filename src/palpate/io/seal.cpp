#include "palpate/io/seal.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "palpate/base/hash.hpp"

namespace palpate {

namespace {

constexpr char magic[17] = "palpate seal 1\r\n";

// The last bytes of the file: the ranges, then this.
struct Seal {
  std::uint64_t structure_hash;  // of all bytes before the ranges that lie in no range
  std::uint64_t ranges;
  std::uint64_t seal_hash;  // of the ranges and the two numbers above
  char magic[16];
};

template <class Byte, class Call>
bool transfer(Call call, int fd, Byte* data, std::size_t size, std::uint64_t offset) {
  while (size > 0) {
    errno = 0;
    const ssize_t done = call(fd, data, size, static_cast<off_t>(offset));
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) return false;
    data += done, size -= static_cast<std::size_t>(done), offset += static_cast<std::uint64_t>(done);
  }
  return true;
}

// Hash of bytes [0, end) that lie in none of the ranges, which must ascend without overlap.
bool structure_hash(int fd, std::uint64_t end, const std::vector<Range>& ranges, std::uint64_t& value) {
  Hash hash;
  std::vector<char> buffer(1 << 16);
  std::uint64_t at = 0;
  const auto add = [&](std::uint64_t to) {
    while (at < to) {
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(buffer.size(), to - at));
      if (!read_at(fd, buffer.data(), n, at)) return false;
      hash.add_bytes(buffer.data(), n);
      at += n;
    }
    return true;
  };
  for (const Range& r : ranges) {
    if (r.offset < at || r.offset > end || r.size > end - r.offset || !add(r.offset)) return false;
    at = r.offset + r.size;
  }
  if (!add(end)) return false;
  value = hash.value();
  return true;
}

std::uint64_t seal_hash(const Seal& seal, const std::vector<Range>& ranges) {
  Hash hash;
  hash.add_bytes(ranges.data(), ranges.size() * sizeof(Range));
  hash.add_bytes(&seal, 2 * sizeof(std::uint64_t));
  return hash.value();
}

}  // namespace

Descriptor::~Descriptor() {
  if (fd >= 0) ::close(fd);
}

bool read_at(int fd, void* data, std::size_t size, std::uint64_t offset) {
  return transfer(::pread, fd, static_cast<char*>(data), size, offset);
}

bool write_at(int fd, const void* data, std::size_t size, std::uint64_t offset) {
  return transfer(::pwrite, fd, static_cast<const char*>(data), size, offset);
}

std::uint64_t file_size(int fd) {
  struct stat status;
  return fstat(fd, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

bool write_seal(int fd, std::vector<Range> ranges) {
  std::sort(ranges.begin(), ranges.end(), [](const Range& a, const Range& b) { return a.offset < b.offset; });
  Seal seal{0, ranges.size(), 0, {}};
  std::memcpy(seal.magic, magic, sizeof seal.magic);
  const std::uint64_t end = file_size(fd);
  if (!structure_hash(fd, end, ranges, seal.structure_hash)) return false;
  seal.seal_hash = seal_hash(seal, ranges);
  const std::size_t bytes = ranges.size() * sizeof(Range);
  return write_at(fd, ranges.data(), bytes, end) && write_at(fd, &seal, sizeof seal, end + bytes);
}

bool sealed_whole(int fd) {
  const std::uint64_t size = file_size(fd);
  Seal seal;
  if (size < sizeof seal || !read_at(fd, &seal, sizeof seal, size - sizeof seal)) return false;
  if (std::memcmp(seal.magic, magic, sizeof seal.magic) != 0) return false;
  if (seal.ranges > (size - sizeof seal) / sizeof(Range)) return false;
  std::vector<Range> ranges(static_cast<std::size_t>(seal.ranges));
  const std::uint64_t end = size - sizeof seal - seal.ranges * sizeof(Range);
  if (!read_at(fd, ranges.data(), ranges.size() * sizeof(Range), end)) return false;
  std::uint64_t value = 0;
  return seal_hash(seal, ranges) == seal.seal_hash && structure_hash(fd, end, ranges, value) &&
         value == seal.structure_hash;
}

}  // namespace palpate
