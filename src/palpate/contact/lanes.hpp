// The compiler's own vectors, for inner loops that keep sums in registers: its loops over arrays of lanes
// keep them in memory. Eight floats whatever the instruction set, so the same bits by every one. Only for
// files that choose among instruction sets (clones.hpp).
#pragma once

#include <cstddef>

namespace palpate {
namespace {

constexpr std::size_t lanes = 8;
using Lanes [[gnu::vector_size(32)]] = float;
// The same anywhere in memory.
using LooseLanes [[gnu::vector_size(32), gnu::aligned(4), gnu::may_alias]] = float;

inline const LooseLanes& at(const float* p) noexcept { return *reinterpret_cast<const LooseLanes*>(p); }
inline LooseLanes& at(float* p) noexcept { return *reinterpret_cast<LooseLanes*>(p); }

inline float total(const Lanes& s) noexcept {
  return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
}

// to += the sums of eight vectors, one in each lane.
inline void add_totals(const Lanes* s, LooseLanes& to) noexcept {
  Lanes pairs[4];
  for (std::size_t i = 0; i < 4; ++i)
    pairs[i] = __builtin_shufflevector(s[2 * i], s[2 * i + 1], 0, 8, 2, 10, 4, 12, 6, 14) +
               __builtin_shufflevector(s[2 * i], s[2 * i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  Lanes fours[2];
  for (std::size_t i = 0; i < 2; ++i)
    fours[i] = __builtin_shufflevector(pairs[2 * i], pairs[2 * i + 1], 0, 1, 8, 9, 4, 5, 12, 13) +
               __builtin_shufflevector(pairs[2 * i], pairs[2 * i + 1], 2, 3, 10, 11, 6, 7, 14, 15);
  to += __builtin_shufflevector(fours[0], fours[1], 0, 1, 2, 3, 8, 9, 10, 11) +
        __builtin_shufflevector(fours[0], fours[1], 4, 5, 6, 7, 12, 13, 14, 15);
}

}  // namespace
}  // namespace palpate
