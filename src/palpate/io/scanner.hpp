// Reads numbers and words out of a file's bytes, text and binary in turn, independent of the locale. What is
// wrong or missing is an Error(format) that names line (text) or byte (binary) and element.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "palpate/base/error.hpp"

namespace palpate {

class Scanner {
 public:
  // `bytes` must outlive it. From `comment` to the end of its line nothing counts ('\0': no comments).
  Scanner(std::string file, std::string_view bytes, char comment = '\0')
      : file_(std::move(file)), bytes_(bytes), comment_(comment) {}

  // Named in errors from now on: "tetrahedron", 17.
  void at(const char* what, std::int64_t number = -1) { what_ = what, number_ = number; }

  bool at_end();                 // nothing but white space and comments is left
  std::string_view word();       // up to the next white space
  std::string_view peek_word();  // the same, not consumed; empty at the end
  std::string_view line();       // the rest of the line, without its end; empty at the file's end
  bool
  line_ends();  // nothing follows on this line but white space, a comment, or a backslash and the next line
  template <class T = double>
  T number();  // finite; T: float, double
  std::int64_t integer();
  // Binary, `swapped` where the file's byte order is not ours.
  template <class T>
  T raw() {
    const std::string_view from = take(sizeof(T));
    std::array<char, sizeof(T)> b;
    std::memcpy(b.data(), from.data(), sizeof(T));
    if (swapped) std::reverse(b.begin(), b.end());
    T value;
    std::memcpy(&value, b.data(), sizeof(T));
    return value;
  }
  std::string_view take(std::uint64_t size);  // so many bytes
  bool swapped = false;

  // A number of things that need at least so many bytes each, checked against what is left of the file.
  std::size_t count(std::int64_t n, std::size_t bytes_each);
  // To be called where a file whose last word is a number was read: cut within it, it looks like another one.
  void require_line_end() const;
  std::size_t left() const { return bytes_.size() - position_; }
  std::size_t position() const { return position_; }
  void move_to(std::uint64_t position);
  // Past the next occurrence of `text`.
  void skip_past(std::string_view text);

  bool binary = false;  // errors name the byte, not the line
  [[noreturn]] void fail(const std::string& problem) const;

 private:
  void skip_space();
  std::string file_;
  std::string_view bytes_;
  std::size_t position_ = 0;
  char comment_;
  const char* what_ = nullptr;
  std::int64_t number_ = -1;
};

// Text of any bytes, short enough for a message.
std::string shown(std::string_view text);

}  // namespace palpate
