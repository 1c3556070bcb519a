#include "palpate/io/scanner.hpp"

#include <charconv>
#include <cmath>

namespace palpate {

namespace {

bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

}  // namespace

std::string shown(std::string_view text) {
  std::string out = "\"";
  for (const char c : text.substr(0, 30)) out += c >= 0x20 && c < 0x7f ? c : '?';
  return out + (text.size() > 30 ? "...\"" : "\"");
}

void Scanner::fail(const std::string& problem) const {
  std::string where;
  if (binary)
    where = fmt::format("byte {}", position_);
  else
    where = fmt::format("line {}", 1 + std::count(bytes_.begin(), bytes_.begin() + position_, '\n'));
  if (what_) where += number_ < 0 ? fmt::format(", {}", what_) : fmt::format(", {} {}", what_, number_);
  throw Error(ErrorKind::format, "{}: {}: {}", file_, where, problem);
}

void Scanner::skip_space() {
  while (position_ < bytes_.size()) {
    const char c = bytes_[position_];
    if (c == comment_ && comment_)
      while (position_ < bytes_.size() && bytes_[position_] != '\n') ++position_;
    else if (is_space(c))
      ++position_;
    else
      return;
  }
}

bool Scanner::at_end() {
  skip_space();
  return position_ == bytes_.size();
}

void Scanner::require_line_end() const {
  if (bytes_.empty() || !is_space(bytes_.back()))
    fail("the file ends within a line: it may be cut; add the line's end if it is whole");
}

std::string_view Scanner::peek_word() {
  skip_space();
  std::size_t end = position_;
  while (end < bytes_.size() && !is_space(bytes_[end])) ++end;
  return bytes_.substr(position_, end - position_);
}

std::string_view Scanner::word() {
  const std::string_view w = peek_word();
  if (w.empty()) fail("the file ends early");
  position_ += w.size();
  return w;
}

std::string_view Scanner::line() {
  const std::size_t end = std::min(bytes_.find('\n', position_), bytes_.size());
  std::string_view text = bytes_.substr(position_, end - position_);
  position_ = std::min(end + 1, bytes_.size());
  if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
  return text;
}

bool Scanner::line_ends() {
  while (position_ < bytes_.size()) {
    const char c = bytes_[position_];
    if (c == '\n' || (c == comment_ && comment_)) return true;
    const std::size_t joint = c != '\\'                                       ? 0
                              : bytes_.compare(position_ + 1, 2, "\r\n") == 0 ? 3
                              : bytes_.compare(position_ + 1, 1, "\n") == 0   ? 2
                                                                              : 0;
    if (joint == 0 && !is_space(c)) return false;
    position_ += std::max<std::size_t>(joint, 1);
  }
  return true;
}

template <class T>
T Scanner::number() {
  skip_space();
  const char* const end = bytes_.data() + bytes_.size();
  const char* begin = bytes_.data() + position_;
  if (begin == end) fail("the file ends early");
  if (*begin == '+') ++begin;
  T value = 0;
  auto [stop, error] = std::from_chars(begin, end, value);
  if (error == std::errc() && stop != end && (*stop == 'd' || *stop == 'D')) {  // Fortran's 1.5D-3
    std::string text(peek_word());
    std::replace(text.begin(), text.end(), stop[0], 'e');
    const char* const first = text.c_str() + (text[0] == '+');
    const auto again = std::from_chars(first, text.c_str() + text.size(), value);
    error = again.ec;
    stop = begin + (again.ptr - first);
  }
  const std::string_view digits(begin, static_cast<std::size_t>(stop - begin));
  if (error == std::errc::result_out_of_range && digits.find_first_of("eE") != std::string_view::npos &&
      digits[digits.find_first_of("eE") + 1] == '-')
    value = 0, error = std::errc();  // smaller than any double
  if (error != std::errc() || (stop != end && !is_space(*stop) && *stop != comment_) || !std::isfinite(value))
    fail("expected a finite number, found " + shown(peek_word()));
  position_ = static_cast<std::size_t>(stop - bytes_.data());
  return value;
}

template float Scanner::number<float>();
template double Scanner::number<double>();

std::int64_t Scanner::integer() {
  skip_space();
  const char* const end = bytes_.data() + bytes_.size();
  const char* begin = bytes_.data() + position_;
  if (begin == end) fail("the file ends early");
  if (*begin == '+') ++begin;
  std::int64_t value = 0;
  const auto [stop, error] = std::from_chars(begin, end, value);
  if (error != std::errc() || (stop != end && !is_space(*stop) && *stop != comment_))
    fail("expected a whole number, found " + shown(peek_word()));
  position_ = static_cast<std::size_t>(stop - bytes_.data());
  return value;
}

std::string_view Scanner::take(std::uint64_t size) {
  if (size > left()) fail(fmt::format("the file ends early: {} bytes are left of {}", left(), size));
  position_ += static_cast<std::size_t>(size);
  return bytes_.substr(position_ - static_cast<std::size_t>(size), static_cast<std::size_t>(size));
}

std::size_t Scanner::count(std::int64_t n, std::size_t bytes_each) {
  if (n < 0 || static_cast<std::uint64_t>(n) > left() / bytes_each)
    fail(fmt::format("a count of {} does not fit into the {} bytes that are left", n, left()));
  return static_cast<std::size_t>(n);
}

void Scanner::move_to(std::uint64_t position) {
  if (position > bytes_.size()) fail(fmt::format("points to byte {}, beyond the file's end", position));
  position_ = static_cast<std::size_t>(position);
}

void Scanner::skip_past(std::string_view text) {
  const std::size_t found = bytes_.find(text, position_);
  if (found == std::string_view::npos) fail(fmt::format("the file ends early: no {}", text));
  position_ = found + text.size();
}

}  // namespace palpate
