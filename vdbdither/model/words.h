#pragma once

#include <span>
#include <string>
#include <string_view>

namespace vdbdither {

/// Returns `a`, `a or b`, `a, b or c`: what a refusal lists.
std::string alternatives(std::span<const std::string> words);

/// Returns `text` with its ASCII letters in lower case.
std::string lowerCase(std::string_view text);

/// Returns `text` without white space at its ends.
std::string_view trimmed(std::string_view text);

/// Returns a number, not negative, with zeros in front where it has fewer than `digits` digits.
std::string zeroPadded(int number, int digits);

/// Whether two ASCII words are equal but for upper and lower case; `lower` is lower case.
bool equalsIgnoringCase(std::string_view word, std::string_view lower);

}  // namespace vdbdither
