// Named errors of the offline stages. Thrown where the trouble is seen, caught at the edges (program,
// server, Python). The kind is also the exit code of the program (docs/errors.md).
#pragma once

#include <fmt/core.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace palpate {

enum class ErrorKind : int {
  internal = 1,      // a bug of ours
  usage = 2,         // wrong options, missing arguments
  file = 3,          // missing, unreadable, unwritable, disk full
  format = 4,        // a file says something it must not: truncated, wrong format, NaN, index out of range
  geometry = 5,      // a mesh unfit for the stage: open, inverted, empty, too thin
  physics = 6,       // no anchor, Poisson's ratio >= 0.5, stiffness not positive definite
  resource = 7,      // more memory than there is
  interrupted = 130  // Ctrl-C
};

// what() is one line: which file, which element, what is wrong and what to do.
class Error : public std::runtime_error {
 public:
  template <class... Args>
  Error(ErrorKind kind, fmt::format_string<Args...> text, Args&&... args)
      : std::runtime_error(fmt::format(text, std::forward<Args>(args)...)), kind_(kind) {}
  ErrorKind kind() const noexcept { return kind_; }

 private:
  ErrorKind kind_;
};

}  // namespace palpate
