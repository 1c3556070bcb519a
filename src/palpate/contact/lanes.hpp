// The compiler's own vectors, for inner loops that keep sums in registers: its loops over arrays of lanes
// keep them in memory. Eight floats whatever the instruction set, so the same bits by every one. Only for
// files that choose among instruction sets (clones.hpp).
#pragma once

#include <cstddef>
#include <cstdint>

namespace palpate {
namespace {

constexpr std::size_t lanes = 8;
using Lanes [[gnu::vector_size(32)]] = float;
using Mask [[gnu::vector_size(32)]] = std::int32_t;
// The same anywhere in memory.
using LooseLanes [[gnu::vector_size(32), gnu::aligned(4), gnu::may_alias]] = float;
using LooseMask [[gnu::vector_size(32), gnu::aligned(4), gnu::may_alias]] = std::int32_t;

inline const LooseLanes& at(const float* p) noexcept { return *reinterpret_cast<const LooseLanes*>(p); }
inline LooseLanes& at(float* p) noexcept { return *reinterpret_cast<LooseLanes*>(p); }

inline float total(const Lanes& s) noexcept {
  return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
}

}  // namespace
}  // namespace palpate
