// What palpate-import writes to its standard output, as in memory: Hello as soon as the format is known,
// then, once all is read, Counts, `vertices` times three float32 and `triangles` times three uint32. float32
// because Coin and Assimp hold no more. On failure one line on standard error and one of the exit codes
// instead.
#pragma once

#include <cstdint>

namespace palpate::import_protocol {

struct Hello {
  char magic[8];
  char format[24];  // "Open Inventor", zero padded
};
struct Counts {
  std::uint64_t vertices, triangles;
};

inline constexpr char magic[8] = {'P', 'A', 'L', 'P', 'T', 'R', 'I', '1'};

enum ExitCode : int { failed = 1, unreadable = 3, malformed = 4, too_big = 7 };

// Limits of one run. A damaged file of a few bytes may ask for any number of triangles (nested USE).
inline constexpr unsigned cpu_seconds = 120, wall_seconds = 600;
constexpr std::uint64_t memory_bytes(std::uint64_t file_bytes) {
  return (std::uint64_t{2} << 30) + 100 * file_bytes;
}

}  // namespace palpate::import_protocol
