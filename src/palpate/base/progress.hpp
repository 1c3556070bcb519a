// Progress and interruption of long work, independent of how it is shown.
#pragma once

#include <atomic>
#include <functional>

#include "palpate/base/error.hpp"

namespace palpate {

// Passed by const reference into long stages; default constructed it is silent and never stops.
struct Progress {
  std::function<void(double fraction)> report;     // called from one thread at a time, fraction in 0..1
  const std::atomic<bool>* interrupted = nullptr;  // set by Ctrl-C

  // Call it now and then. Throws Error(interrupted) when asked to stop.
  void at(double fraction) const {
    if (interrupted && interrupted->load(std::memory_order_relaxed))
      throw Error(ErrorKind::interrupted, "interrupted; nothing was written");
    if (report) report(fraction);
  }
};

}  // namespace palpate
