#include "vdbdither/model/printable.h"

#include <cstdint>

namespace vdbdither {

namespace {

/// A character of UTF-8, or a byte that is none.
struct Character {
  std::size_t size = 1;
  bool valid = false;
  std::uint32_t code = 0;
};

/// The first character of `text`, which is not empty.
Character firstOf(std::string_view text) {
  const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(text[at]); };
  const unsigned char lead = byte(0);
  if (lead < 0x80) return {1, true, lead};
  const std::size_t size = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < size) return {};
  std::uint32_t code = lead & (0x7F >> size);
  for (std::size_t at = 1; at < size; ++at) {
    if ((byte(at) & 0xC0) != 0x80) return {};
    code = code << 6 | (byte(at) & 0x3F);
  }
  const bool overlong = (size == 3 && code < 0x800) || (size == 4 && code < 0x10000);
  if (overlong || code > 0x10FFFF || (code >= 0xD800 && code <= 0xDFFF)) return {};
  return {size, true, code};
}

bool isPrintable(const Character& c) {
  if (!c.valid || c.code < 0x20 || (c.code >= 0x7F && c.code < 0xA0)) return false;
  const bool turns = c.code == 0x061C || c.code == 0x200E || c.code == 0x200F ||
                     (c.code >= 0x202A && c.code <= 0x202E) ||
                     (c.code >= 0x2066 && c.code <= 0x2069);
  return !turns && c.code != 0x2028 && c.code != 0x2029;
}

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
    const Character c = firstOf(text);
    const std::string_view bytes = text.substr(0, c.size);
    if (!escape(result, c, bytes)) result += bytes;
    text.remove_prefix(c.size);
  }
  return result;
}

}  // namespace

bool isPrintable(std::string_view text) {
  while (!text.empty()) {
    const Character c = firstOf(text);
    if (!isPrintable(c)) return false;
    text.remove_prefix(c.size);
  }
  return true;
}

std::string printable(std::string_view text) {
  return copied(text, [](std::string& result, const Character& c, std::string_view bytes) {
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
  return copied(text, [](std::string& result, const Character& c, std::string_view bytes) {
    if (isPrintable(c) || bytes == "\n" || bytes == "\t") return false;
    appendEscaped(result, bytes);
    return true;
  });
}

std::string validUtf8(std::string_view text) {
  return copied(text, [](std::string& result, const Character& c, std::string_view bytes) {
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
