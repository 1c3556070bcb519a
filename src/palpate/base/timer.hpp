// Clocks and memory of this process.
#pragma once

#include <cstddef>
#include <ctime>

namespace palpate {

// Seconds since construction, by one of the system's clocks.
class Timer {
 public:
  explicit Timer(clockid_t clock) noexcept : clock_(clock), start_(now()) {}
  double seconds() const noexcept { return now() - start_; }

 private:
  double now() const noexcept {
    timespec t;
    clock_gettime(clock_, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  }
  clockid_t clock_;
  double start_;
};

inline Timer wall_timer() noexcept { return Timer(CLOCK_MONOTONIC); }
inline Timer cpu_timer() noexcept { return Timer(CLOCK_PROCESS_CPUTIME_ID); }
inline Timer thread_timer() noexcept { return Timer(CLOCK_THREAD_CPUTIME_ID); }

std::size_t resident_bytes();       // now
std::size_t peak_resident_bytes();  // since the process began
std::size_t available_bytes();      // memory the system could still give, cgroup limit included

}  // namespace palpate
