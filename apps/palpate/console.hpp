// What a person or a script sees: one line a stage on stdout, a progress bar with time left on stderr when
// that is a terminal, and with --json one object on stdout instead of lines.
#pragma once

#include <atomic>
#include <cstdio>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "palpate/base/progress.hpp"

namespace palpate {

class Console {
 public:
  bool json = false;
  int threads = 0;

  // A line for people; nothing with --json.
  void line(const std::string& text) const;
  // The one object for scripts; nothing without --json.
  void object(const nlohmann::json& value) const;
  // A bar for one stage, drawn while fractions come in, erased when it is destroyed; stopped by Ctrl-C.
  Progress progress(const std::string& label) const;
};

// Set by SIGINT and SIGTERM once main() has called catch_interrupts().
extern std::atomic<bool> interrupted;
void catch_interrupts();

std::string human_bytes(std::size_t bytes);  // "324.0 MB"
std::string human_time(double seconds);      // "2.31 s", "0.8 ms", "3 min 20 s"

}  // namespace palpate
