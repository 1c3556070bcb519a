// 64-bit FNV-1a over bytes, for provenance ("was this model made from that mesh?") and file checksums.
// Not cryptographic. Fowler, Noll, Vo 1991.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

class Hash {
 public:
  void add_bytes(const void* data, std::size_t size) noexcept {
    const auto* p = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) value_ = (value_ ^ p[i]) * 0x100000001b3u;
  }
  // T must have no padding.
  template <class T>
  void add(std::span<const T> values) noexcept {
    add_bytes(values.data(), values.size_bytes());
  }
  std::uint64_t value() const noexcept { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325u;
};

}  // namespace palpate
