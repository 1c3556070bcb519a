// The end of a container file: which bytes the arrays occupy, and a hash over all others (HDF5's structure).
// HDF5 readers ignore it. libhdf5 crashes on some damaged files or asks them for absurd memory; it sees ours
// only when the seal was found whole.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace palpate {

struct Range {
  std::uint64_t offset, size;  // bytes
};

// An open file, closed at the end.
struct Descriptor {
  int fd = -1;
  explicit Descriptor(int f) : fd(f) {}
  ~Descriptor();
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
};

// All of it, whatever the system takes at a time. False: errno says why; 0 where the file ends early.
bool read_at(int fd, void* data, std::size_t size, std::uint64_t offset);
bool write_at(int fd, const void* data, std::size_t size, std::uint64_t offset);
std::uint64_t file_size(int fd);

// Appends the seal. False: errno says why.
bool write_seal(int fd, std::vector<Range> ranges);
// Whether the file ends in a seal that fits the rest; costs the structure's size, not the arrays'.
bool sealed_whole(int fd);

}  // namespace palpate
