// Words and numbers of a text in memory, line by line; whatever is wrong is said with its line.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "palpate/base/error.hpp"

namespace palpate {

class TextReader {
 public:
  // `name` is the file's name in messages. With `continued`, a backslash at the end of a line joins the next.
  // `lines` lines of the file come before the text.
  TextReader(std::string_view text, std::string name, bool continued = false, std::size_t lines = 0)
      : text_(text), name_(std::move(name)), continued_(continued), line_(lines) {}

  bool next_line();                          // false at the end of the text; \n, \r\n and \r all end lines
  std::string_view word();                   // next word of this line, empty at its end
  std::string_view word_anywhere();          // next word, on later lines too; empty at the end of the text
  double number(std::string_view w);         // what a word says: a finite number,
  std::int64_t integer(std::string_view w);  // or a whole one; fails on anything else
  std::size_t line() const { return line_; }
  std::size_t left() const { return text_.size() - at_ + rest_.size(); }  // bytes not yet read

  // Throws Error(format) "NAME: line N: ...".
  template <class... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> text, Args&&... args) const {
    throw Error(ErrorKind::format, "{}: line {}: {}", name_, line_,
                fmt::format(text, std::forward<Args>(args)...));
  }

 private:
  [[noreturn]] void not_a(const char* kind, std::string_view w) const;

  std::string_view text_;
  std::string name_;
  bool continued_;
  std::size_t at_ = 0;     // first byte of the next line
  std::string_view rest_;  // what is left of this line
  std::size_t line_;
};

// A word of a damaged file as it can be shown in a message: short and printable.
std::string printable(std::string_view word);

}  // namespace palpate
