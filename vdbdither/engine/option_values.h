#pragma once

#include <limits>
#include <span>
#include <string>
#include <string_view>

namespace vdbdither {

/// The finite numbers that an option accepts.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool accepts_min = true;  ///< whether `min` itself is accepted

  /// The numbers above `min`, which is not one of them.
  static constexpr Range above(double min, double max = std::numeric_limits<double>::infinity()) {
    return {min, max, false};
  }

  [[nodiscard]] bool contains(double value) const;

  /// The range in words, such as `from 0.01 mm to 1 mm` or `greater than 0`; empty where every
  /// number is accepted.
  [[nodiscard]] std::string text(std::string_view unit = "") const;
};

/// Reads the whole of `text` as a finite number within `range`. A negative zero becomes zero.
/// Throws UsageError that says that the value must be `what`.
double parseNumber(std::string_view text, const Range& range, const std::string& what);

/// Reads `0.042mm`, `42um`, `600dpi` (25.4/600), `1.5in`, `2cm`, or a plain number of mm. Throws
/// UsageError where the text is not a length, or not one within `range`.
double parseLengthMm(std::string_view text, const Range& range = {});

/// The shortest text that reads back as the same double.
std::string shortestText(double value);

/// Returns `word` as a shell and splitWords read it: unchanged if it is plain, otherwise in quotes,
/// with what is not printable as escapes, so that the result is always a single line of UTF-8.
std::string quotedForShell(std::string_view word);

/// The candidate nearest to `word` by edit distance, or an empty text where none is near.
std::string nearestWord(std::string_view word, std::span<const std::string> candidates);

}  // namespace vdbdither
