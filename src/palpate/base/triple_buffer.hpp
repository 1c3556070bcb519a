// The newest value from one thread to another: neither ever waits, values in between are lost.
//
// Three slots. The writer owns one (back), the reader one (front), the third lies in the middle. One atomic
// byte holds the middle's number and whether it is fresh, that is published and not fetched yet:
//   publish: exchange(back | fresh)   the writer gives its slot away and gets the one that lay in the middle;
//   fetch:   exchange(front)          the reader gives its slot away and gets the newest. If the middle is
//                                     not fresh, it does nothing and keeps the slot it has.
// The numbers only change owners, so no slot is ever in two hands; acquire and release make what was written
// into a slot before one exchange visible after the next. One writer thread, one reader thread.
#pragma once

#include <atomic>
#include <cstdint>

namespace palpate {

template <class T>
class TripleBuffer {
 public:
  // All slots begin as this value: memory that T's own size depends on is taken here, never later.
  explicit TripleBuffer(const T& initial = T{}) : slots_{{initial}, {initial}, {initial}} {}
  TripleBuffer(const TripleBuffer&) = delete;
  TripleBuffer& operator=(const TripleBuffer&) = delete;

  // Writer. back() holds some older value, not the last one published.
  T& back() noexcept { return slots_[back_].value; }
  void publish() noexcept {
    back_ = middle_.exchange(static_cast<std::uint8_t>(back_ | fresh), std::memory_order_acq_rel) & number;
  }

  // Reader. fetch: true when there is something newer; front() is then that, otherwise what it was.
  bool fetch() noexcept {
    if (!(middle_.load(std::memory_order_relaxed) & fresh)) return false;
    front_ = middle_.exchange(front_, std::memory_order_acq_rel) & number;
    return true;
  }
  const T& front() const noexcept { return slots_[front_].value; }
  T& front() noexcept { return slots_[front_].value; }  // the reader's own until the next fetch

 private:
  static constexpr std::uint8_t number = 3, fresh = 4;
  struct alignas(64) Slot {  // a cache line of its own
    T value;
  };
  Slot slots_[3];
  alignas(64) std::atomic<std::uint8_t> middle_{2};
  alignas(64) std::uint8_t back_ = 0;
  alignas(64) std::uint8_t front_ = 1;
};

}  // namespace palpate
