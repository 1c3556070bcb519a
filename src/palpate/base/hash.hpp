// 64-bit hash of bytes, for provenance ("was this model made from that mesh?") and file checksums. Not
// cryptographic. Eight bytes a step: h = mix((h ^ word) * K), mix(x) = x ^ (x >> 32), words little-endian,
// the last one filled with zeros, then the length in bytes as one more word. A step is a bijection of h and
// of the word, so damage within one aligned word always changes the value. The shift matters: without it a
// changed sign in two numbers would cancel (a product carries nothing downwards). Fowler, Noll, Vo 1991 with
// Steele, Lea, Flood 2014's constant.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace palpate {

static_assert(std::endian::native == std::endian::little, "files and hashes are little-endian");

// The value depends on the bytes alone, not on how they were divided into calls.
class Hash {
 public:
  void add_bytes(const void* data, std::size_t size) noexcept {
    const auto* p = static_cast<const unsigned char*>(data);
    const auto* end = p + size;
    for (; p != end && length_ % 8 != 0; ++p) add_byte(*p);
    for (; end - p >= 8; p += 8, length_ += 8) {
      std::uint64_t word;
      std::memcpy(&word, p, 8);
      value_ = step(value_, word);
    }
    for (; p != end; ++p) add_byte(*p);
  }
  // T must have no padding.
  template <class T>
  void add(std::span<const T> values) noexcept {
    add_bytes(values.data(), values.size_bytes());
  }
  std::uint64_t value() const noexcept {
    return step(length_ % 8 ? step(value_, partial_) : value_, length_);
  }

 private:
  static std::uint64_t step(std::uint64_t h, std::uint64_t word) noexcept {
    h = (h ^ word) * 0x9e3779b97f4a7c15u;
    return h ^ (h >> 32);
  }
  void add_byte(unsigned char byte) noexcept {
    partial_ |= std::uint64_t(byte) << (8 * (length_ % 8));
    if (++length_ % 8 == 0) value_ = step(value_, partial_), partial_ = 0;
  }

  std::uint64_t value_ = 0xcbf29ce484222325u, partial_ = 0, length_ = 0;
};

}  // namespace palpate
