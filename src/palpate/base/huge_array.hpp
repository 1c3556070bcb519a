// Fixed-size array for data that is streamed at haptic rate, on 2 MiB pages where the kernel has them:
// random columns of a large matrix cost a TLB miss each on 4 KiB pages.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace palpate {

// Zeroed memory on huge pages. Throws Error(resource) when the system has none left.
void* huge_allocate(std::size_t bytes);
void huge_free(void* memory, std::size_t bytes) noexcept;

template <class T>
class HugeArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  HugeArray() = default;
  explicit HugeArray(std::size_t size)
      : data_(size ? static_cast<T*>(huge_allocate(size * sizeof(T))) : nullptr), size_(size) {}
  HugeArray(HugeArray&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
  HugeArray& operator=(HugeArray&& other) noexcept {
    std::swap(data_, other.data_), std::swap(size_, other.size_);
    return *this;
  }
  ~HugeArray() {
    if (data_) huge_free(data_, size_ * sizeof(T));
  }

  T* data() noexcept { return data_; }
  const T* data() const noexcept { return data_; }
  std::size_t size() const noexcept { return size_; }
  T& operator[](std::size_t i) noexcept { return data_[i]; }
  const T& operator[](std::size_t i) const noexcept { return data_[i]; }
  operator std::span<T>() noexcept { return {data_, size_}; }
  operator std::span<const T>() const noexcept { return {data_, size_}; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

// The same for std::vector; what is smaller than a huge page comes from the heap.
template <class T>
struct HugeAllocator {
  using value_type = T;
  HugeAllocator() = default;
  template <class U>
  HugeAllocator(const HugeAllocator<U>&) noexcept {}
  static constexpr std::size_t page = std::size_t{1} << 21;
  T* allocate(std::size_t n) {
    return n * sizeof(T) < page ? std::allocator<T>().allocate(n)
                                : static_cast<T*>(huge_allocate(n * sizeof(T)));
  }
  void deallocate(T* memory, std::size_t n) noexcept {
    if (n * sizeof(T) < page)
      std::allocator<T>().deallocate(memory, n);
    else
      huge_free(memory, n * sizeof(T));
  }
  bool operator==(const HugeAllocator&) const noexcept { return true; }
};
template <class T>
using HugeVector = std::vector<T, HugeAllocator<T>>;

}  // namespace palpate
