#include "vdbdither/model/printable.h"

#include <algorithm>
#include <array>
#include <utility>

namespace vdbdither {

Utf8Character firstCharacter(std::string_view text) {
  const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(text[at]); };
  const unsigned char lead = byte(0);
  if (lead < 0x80) return {1, true, lead};
  const std::size_t size = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < size) return {};
  char32_t code = lead & (0x7FU >> size);
  for (std::size_t at = 1; at < size; ++at) {
    if ((byte(at) & 0xC0) != 0x80) return {};
    code = code << 6 | (byte(at) & 0x3FU);
  }
  const bool overlong = (size == 3 && code < 0x800) || (size == 4 && code < 0x10000);
  if (overlong || code > 0x10FFFF || (code >= 0xD800 && code <= 0xDFFF)) return {};
  return {size, true, code};
}

bool isPrintable(const Utf8Character& character) {
  constexpr std::array<std::pair<char32_t, char32_t>, 8> hidden{{{0x00, 0x1F},
                                                                 {0x7F, 0x9F},
                                                                 {0x061C, 0x061C},
                                                                 {0x200E, 0x200F},
                                                                 {0x2028, 0x202E},
                                                                 {0x2066, 0x2069},
                                                                 {0xFEFF, 0xFEFF},
                                                                 {0xFFF9, 0xFFFB}}};
  return character.valid && std::none_of(hidden.begin(), hidden.end(), [&](const auto& range) {
           return character.code >= range.first && character.code <= range.second;
         });
}

namespace {

void appendEscaped(std::string& text, std::string_view bytes) {
  constexpr std::string_view digits = "0123456789abcdef";
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    text.append("\\x").append(1, digits[byte >> 4]).append(1, digits[byte & 15]);
  }
}

/// Copies `text`; `escape` appends the characters for which it returns true itself.
template <typename Escape>
std::string copied(std::string_view text, const Escape& escape) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const Utf8Character c = firstCharacter(text);
    const std::string_view bytes = text.substr(0, c.size);
    if (!escape(result, c, bytes)) result += bytes;
    text.remove_prefix(c.size);
  }
  return result;
}

}  // namespace

bool isPrintable(std::string_view text) {
  while (!text.empty()) {
    const Utf8Character c = firstCharacter(text);
    if (!isPrintable(c)) return false;
    text.remove_prefix(c.size);
  }
  return true;
}

std::string printable(std::string_view text) {
  return copied(text, [](std::string& result, const Utf8Character& c, std::string_view bytes) {
    if (isPrintable(c)) return false;
    if (bytes == "\n") {
      result += "\\n";
    } else if (bytes == "\t") {
      result += "\\t";
    } else if (bytes == "\r") {
      result += "\\r";
    } else {
      appendEscaped(result, bytes);
    }
    return true;
  });
}

std::string printableLines(std::string_view text) {
  return copied(text, [](std::string& result, const Utf8Character& c, std::string_view bytes) {
    if (isPrintable(c) || bytes == "\n" || bytes == "\t") return false;
    appendEscaped(result, bytes);
    return true;
  });
}

std::string validUtf8(std::string_view text) {
  return copied(text, [](std::string& result, const Utf8Character& c, std::string_view bytes) {
    if (!c.valid) appendEscaped(result, bytes);
    return !c.valid;
  });
}

std::string shortened(std::string_view text, std::size_t longest) {
  if (text.size() <= longest) return std::string(text);
  // A character is not cut in two.
  std::size_t end = longest;
  while (end > 0 && longest - end < 3 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80)
    --end;
  return std::string(text.substr(0, end)) + "... (" + std::to_string(text.size()) + " bytes)";
}

}  // namespace vdbdither
