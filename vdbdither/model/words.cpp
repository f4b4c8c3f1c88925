#include "vdbdither/model/words.h"

#include <algorithm>
#include <cstddef>

namespace vdbdither {

namespace {

char lowerCaseOf(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

}  // namespace

std::string alternatives(std::span<const std::string> words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) text += i + 1 == words.size() ? " or " : ", ";
    text += words[i];
  }
  return text;
}

std::string lowerCase(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(), lowerCaseOf);
  return lower;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view blanks = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(blanks);
  if (begin == text.npos) return {};
  return text.substr(begin, text.find_last_not_of(blanks) - begin + 1);
}

std::string zeroPadded(int number, int digits) {
  std::string text = std::to_string(number);
  const auto size = static_cast<std::size_t>(digits);
  if (text.size() < size) text.insert(0, size - text.size(), '0');
  return text;
}

bool equalsIgnoringCase(std::string_view word, std::string_view lower) {
  return std::equal(word.begin(), word.end(), lower.begin(), lower.end(),
                    [](char c, char wanted) { return lowerCaseOf(c) == wanted; });
}

}  // namespace vdbdither
