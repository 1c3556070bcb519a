#include "palpate/simulation/model.hpp"

#include "palpate/base/error.hpp"

namespace palpate {

namespace {
constexpr std::array<const char*, 4> mode_names{"unilateral", "prescribed", "gaussian", "imprint"};
}  // namespace

const char* name(Mode mode) { return mode_names[static_cast<std::size_t>(mode)]; }

Mode parse_mode(const std::string& text) {
  for (std::size_t i = 0; i < mode_names.size(); ++i)
    if (text == mode_names[i]) return static_cast<Mode>(i);
  throw Error(ErrorKind::usage, "'{}' is no mode; use unilateral, prescribed, gaussian or imprint", text);
}

}  // namespace palpate
