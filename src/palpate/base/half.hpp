// float16 (IEEE 754 binary16) as bits, for CPUs without it. Rounds to nearest, ties to even.
#pragma once

#include <cstdint>
#include <cstring>

namespace palpate {

inline std::uint16_t to_half(float value) noexcept {
  std::uint32_t bits;
  std::memcpy(&bits, &value, 4);
  const std::uint32_t sign = bits >> 16 & 0x8000u;
  bits &= 0x7fffffffu;
  if (bits >= 0x47800000u) return static_cast<std::uint16_t>(sign | (bits > 0x7f800000u ? 0x7e00u : 0x7c00u));
  if (bits < 0x38800000u) {  // subnormal: adding 1/2 leaves the fraction, rounded, in the last bits
    float magnitude, shifted = 0.5f;
    std::memcpy(&magnitude, &bits, 4);
    shifted += magnitude;
    std::memcpy(&bits, &shifted, 4);
    return static_cast<std::uint16_t>(sign | (bits - 0x3f000000u));
  }
  bits += 0xc8000fffu + (bits >> 13 & 1u);  // exponent bias 127 to 15, and half of what is cut off
  return static_cast<std::uint16_t>(sign | bits >> 13);
}

inline float from_half(std::uint16_t half) noexcept {
  const std::uint32_t sign = static_cast<std::uint32_t>(half & 0x8000u) << 16;
  std::uint32_t bits = static_cast<std::uint32_t>(half & 0x7fffu) << 13;
  const std::uint32_t exponent = bits & 0x0f800000u;
  bits += 0x38000000u;
  if (exponent == 0x0f800000u) bits += 0x38000000u;  // infinite or no number
  float value;
  if (exponent == 0) {  // subnormal
    bits += 0x00800000u;
    std::memcpy(&value, &bits, 4);
    value -= 6.103515625e-05f;
  } else {
    std::memcpy(&value, &bits, 4);
  }
  std::uint32_t out;
  std::memcpy(&out, &value, 4);
  out |= sign;
  std::memcpy(&value, &out, 4);
  return value;
}

}  // namespace palpate
