#include "palpate/io/text_reader.hpp"

#include <charconv>
#include <cmath>
#include <cstdlib>

namespace palpate {

namespace {
constexpr std::string_view blanks = " \t\v\f";
}

std::string printable(std::string_view word) {
  std::string shown;
  for (const char c : word.substr(0, 40)) shown += c >= ' ' && c <= '~' ? c : '?';
  return word.size() > 40 ? shown + "..." : shown;
}

bool TextReader::next_line() {
  if (at_ >= text_.size()) {
    rest_ = {};
    return false;
  }
  const std::size_t end = std::min(text_.find_first_of("\n\r", at_), text_.size());
  rest_ = text_.substr(at_, end - at_);
  at_ = std::min(text_.size(), end + (text_.substr(end, 2) == "\r\n" ? 2 : 1));
  ++line_;
  return true;
}

std::string_view TextReader::word() {
  for (;;) {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(blanks), rest_.size()));
    std::string_view w = rest_.substr(0, rest_.find_first_of(blanks));
    rest_.remove_prefix(w.size());
    if (!continued_ || w.empty() || w.back() != '\\' || rest_.find_first_not_of(blanks) != rest_.npos)
      return w;
    w.remove_suffix(1);
    if (!next_line() || !w.empty()) return w;
  }
}

std::string_view TextReader::word_anywhere() {
  for (;;) {
    const std::string_view w = word();
    if (!w.empty() || !next_line()) return w;
  }
}

void TextReader::not_a(const char* kind, std::string_view w) const {
  if (!w.empty()) fail("\"{}\" is not a {}", printable(w), kind);
  fail("{}a {} is missing", left() == 0 ? "the file ends, " : "", kind);
}

double TextReader::number(std::string_view w) {
  const std::string_view digits = w.substr(w.size() > 1 && w[0] == '+' && w[1] != '-' ? 1 : 0);
  double value = 0;
  auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc::result_out_of_range)  // tiny ones are zero, huge ones are caught below
    value = std::strtod(std::string(digits).c_str(), nullptr);
  else if (error != std::errc() || end != digits.data() + digits.size())
    not_a("number", w);
  if (!std::isfinite(value)) fail("\"{}\" is not a finite number", printable(w));
  return value;
}

std::int64_t TextReader::integer(std::string_view w) {
  const std::string_view digits = w.substr(w.size() > 1 && w[0] == '+' && w[1] != '-' ? 1 : 0);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size()) not_a("whole number", w);
  return value;
}

}  // namespace palpate
