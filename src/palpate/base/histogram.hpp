// Times counted in bins of 3 %, without allocating: what percentiles a million ticks have.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace palpate {

class Histogram {
 public:
  void add(double seconds) noexcept {
    const double octaves = std::log2(std::max(seconds, smallest) / smallest);
    ++counts_[std::min(static_cast<std::size_t>(octaves * per_octave), counts_.size() - 1)];
    ++total_;
    worst_ = std::max(worst_, seconds);
    sum_ += seconds;
  }
  // The time that this share (0 to 1) of all keeps to: the upper end of its bin, s. 0 where there is none.
  double percentile(double share) const noexcept {
    const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(total_)));
    std::uint64_t below = 0;
    for (std::size_t bin = 0; bin < counts_.size() && total_ > 0; ++bin)
      if ((below += counts_[bin]) >= std::max<std::uint64_t>(wanted, 1)) return std::min(worst_, end_of(bin));
    return 0;
  }
  // Calls f(the bin's upper end in s, how many are in it) for each bin that is not empty, upwards. The first
  // holds what is shorter, too, the last what is longer.
  template <class F>
  void each_bin(const F& f) const {
    for (std::size_t bin = 0; bin < counts_.size(); ++bin)
      if (counts_[bin] > 0) f(end_of(bin), counts_[bin]);
  }
  double worst() const noexcept { return worst_; }  // s, exact
  double mean() const noexcept { return total_ ? sum_ / static_cast<double>(total_) : 0; }
  std::uint64_t count() const noexcept { return total_; }

  static constexpr double smallest = 1e-8;  // s, where the first bin begins

 private:
  static constexpr double per_octave = 24;  // of 40 octaves: 3 hours
  static double end_of(std::size_t bin) noexcept {
    return smallest * std::exp2(static_cast<double>(bin + 1) / per_octave);
  }
  std::array<std::uint64_t, 960> counts_{};
  std::uint64_t total_ = 0;
  double worst_ = 0, sum_ = 0;
};

}  // namespace palpate
