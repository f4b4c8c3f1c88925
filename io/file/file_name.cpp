#include "io/file/file_name.h"

#include <array>
#include <cstdint>
#include <cstdio>
#include <utility>

namespace vdbdither {

namespace {

/// Takes the first character off `text`. Returns nothing where it is not well-formed UTF-8
/// (Unicode 15, table 3-7).
std::optional<char32_t> takeCharacter(std::string_view& text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t lead = byte(0);
  const std::size_t length = lead < 0x80                   ? 1
                             : lead >= 0xc2 && lead < 0xe0 ? 2
                             : lead >= 0xe0 && lead < 0xf0 ? 3
                             : lead >= 0xf0 && lead < 0xf5 ? 4
                                                           : 0;
  if (length == 0 || length > text.size()) return std::nullopt;
  char32_t character = length == 1 ? lead : lead & (0x7f >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return std::nullopt;
    character = character << 6 | (byte(i) & 0x3f);
  }
  constexpr std::array<char32_t, 5> least{0, 0, 0x80, 0x800, 0x10000};
  if (character < least[length] || character > 0x10ffff ||
      (character >= 0xd800 && character < 0xe000))
    return std::nullopt;
  text.remove_prefix(length);
  return character;
}

/// Control characters, separators of lines, and what changes the direction of the text around it.
bool prints(char32_t character) {
  constexpr std::array<std::pair<char32_t, char32_t>, 7> hidden{{{0x00, 0x1f},
                                                                 {0x7f, 0x9f},
                                                                 {0x200e, 0x200f},
                                                                 {0x2028, 0x202e},
                                                                 {0x2066, 0x2069},
                                                                 {0xfeff, 0xfeff},
                                                                 {0xfff9, 0xfffb}}};
  for (const auto& [first, last] : hidden) {
    if (character >= first && character <= last) return false;
  }
  return true;
}

}  // namespace

std::optional<std::string> fileNameProblem(std::string_view name) {
  if (name.empty()) return "is empty";
  if (name == "." || name == "..") return "is '" + std::string(name) + "'";
  if (name.size() > longest_file_name) {
    return "has " + std::to_string(name.size()) + " bytes; the maximum is " +
           std::to_string(longest_file_name);
  }
  while (!name.empty()) {
    const std::optional<char32_t> character = takeCharacter(name);
    if (!character) return "is not UTF-8";
    if (*character == '/' || *character == '\\')
      return std::string("contains '") + static_cast<char>(*character) + "'";
    if (!prints(*character)) {
      std::array<char, 16> code{};
      std::snprintf(code.data(), code.size(), "U+%04X", static_cast<unsigned>(*character));
      return std::string("contains the unprintable character ") + code.data();
    }
  }
  return std::nullopt;
}

std::optional<std::string> relativePathProblem(std::string_view path) {
  if (path.starts_with('/')) return "is an absolute path";
  for (;;) {
    const std::size_t slash = path.find('/');
    if (auto problem = fileNameProblem(path.substr(0, slash))) {
      return slash == path.npos ? problem : "has a folder whose name " + *problem;
    }
    if (slash == path.npos) return std::nullopt;
    path.remove_prefix(slash + 1);
  }
}

}  // namespace vdbdither
