#pragma once

#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>
#include <system_error>

#include "vdbdither/model/words.h"

namespace vdbdither {

/// Walks through a text by lines, words and numbers. "\n", "\r" and "\r\n" end a line; a backslash
/// at the end of a line, also before blanks, continues it.
class TextCursor {
 public:
  /// Whether '#' begins a comment, also within a word. A comment ends with its line.
  enum class Comments { none, hash };

  explicit TextCursor(std::string_view text, Comments comments = Comments::none)
      : at_(text.data()),
        end_(text.data() + text.size()),
        has_comments_(comments == Comments::hash) {}

  [[nodiscard]] const char* position() const { return at_; }
  [[nodiscard]] bool atEnd() const { return at_ == end_; }
  [[nodiscard]] bool atLineEnd() const { return endsLine(at_); }

  void skipBlanks() {
    for (;;) {
      if (at_ != end_ && isBlank(*at_)) {
        ++at_;
      } else if (continuesLine(at_)) {
        for (++at_; isBlank(*at_);) ++at_;
        skipLineEnd();
      } else if (beginsComment(at_)) {
        line();
      } else {
        return;
      }
    }
  }

  /// To the next word, over ends of lines.
  void skipSpace() {
    for (skipBlanks(); !atEnd() && atLineEnd(); skipBlanks()) ++at_;
  }

  /// To the start of the next line; backslashes do not continue this one.
  void skipLine() {
    line();
    skipLineEnd();
  }

  /// The rest of the line.
  std::string_view line() {
    const char* begin = at_;
    while (at_ != end_ && (isPlain(*at_) || !endsLine(at_))) ++at_;
    return {begin, at_};
  }

  /// The next word of this line, empty at its end.
  std::string_view word() {
    skipBlanks();
    const char* begin = at_;
    while (at_ != end_ && (isPlain(*at_) || !endsWord(at_))) ++at_;
    return {begin, at_};
  }

  /// The next word of this line if it is a number, also "inf" or "nan"; else the cursor stays
  /// before it.
  std::optional<double> number() {
    skipBlanks();
    if (const auto value = shortNumber()) return value;
    const char* begin = at_;
    if (end_ - begin > 1 && begin[0] == '+' && begin[1] != '-') ++begin;
    double value = 0;
    auto [stop, error] = std::from_chars(begin, end_, value);
    if (error == std::errc::invalid_argument || !endsWord(stop)) return std::nullopt;
    if (error == std::errc::result_out_of_range) value = extreme(begin, stop);
    at_ = stop;
    return value;
  }

 private:
  [[nodiscard]] bool endsLine(const char* at) const {
    return at == end_ || *at == '\n' || *at == '\r';
  }
  [[nodiscard]] bool continuesLine(const char* at) const {
    if (at == end_ || *at != '\\') return false;
    for (++at; at != end_ && isBlank(*at);) ++at;
    return at != end_ && endsLine(at);
  }
  [[nodiscard]] bool beginsComment(const char* at) const {
    return has_comments_ && at != end_ && *at == '#';
  }
  [[nodiscard]] bool endsWord(const char* at) const {
    return endsLine(at) || isBlank(*at) || continuesLine(at) || beginsComment(at);
  }
  static bool isBlank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
  /// One comparison classifies most characters as part of a word.
  static bool isPlain(char c) { return static_cast<signed char>(c) > '#' && c != '\\'; }
  void skipLineEnd() {
    if (at_ != end_ && *at_ == '\r') {
      ++at_;
      if (at_ != end_ && *at_ == '\n') ++at_;
    } else if (at_ != end_) {
      ++at_;
    }
  }

  /// `number` for the usual case, several times as fast: up to 15 digits and a power of ten up to
  /// 22 are both exact in double, so that one multiplication or division rounds as it must (W. D.
  /// Clinger, "How to Read Floating Point Numbers Accurately", 1990).
  std::optional<double> shortNumber() {
    const char* at = at_;
    const bool negative = at != end_ && *at == '-';
    at += negative;
    std::uint64_t digits = 0;
    const auto read_digits = [&](std::uint64_t& value) {
      const char* begin = at;
      for (; at != end_ && *at >= '0' && *at <= '9'; ++at) {
        value = value * 10 + static_cast<std::uint64_t>(*at - '0');
      }
      return at - begin;
    };
    auto digit_count = read_digits(digits);
    std::ptrdiff_t exponent = 0;
    if (at != end_ && *at == '.') {
      ++at;
      exponent = -read_digits(digits);
      digit_count -= exponent;
    }
    if (digit_count == 0 || digit_count > 15) return std::nullopt;
    if (at != end_ && (*at == 'e' || *at == 'E')) {
      ++at;
      const bool small = at != end_ && *at == '-';
      at += small || (at != end_ && *at == '+');
      std::uint64_t power = 0;
      const auto power_digits = read_digits(power);
      if (power_digits == 0 || power_digits > 3) return std::nullopt;
      exponent += small ? -static_cast<std::ptrdiff_t>(power) : static_cast<std::ptrdiff_t>(power);
    }
    if (exponent < -22 || exponent > 22 || !endsWord(at)) return std::nullopt;
    static constexpr std::array<double, 23> powers{1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                                   1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                                   1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    const auto mantissa = static_cast<double>(digits);
    const double value = exponent < 0 ? mantissa / powers[static_cast<std::size_t>(-exponent)]
                                      : mantissa * powers[static_cast<std::size_t>(exponent)];
    at_ = at;
    return negative ? -value : value;
  }

  /// A number beyond the range of double is zero or infinite; from_chars does not say which.
  static double extreme(const char* begin, const char* end) {
    long double value = std::numeric_limits<long double>::infinity();
    std::from_chars(begin, end, value);
    return static_cast<double>(value);
  }

  const char* at_;
  const char* end_;
  bool has_comments_;
};

}  // namespace vdbdither
