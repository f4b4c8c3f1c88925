#pragma once

#include <string>
#include <string_view>

namespace vdbdither {

// Names and texts of files can hold any bytes. What is shown to the user passes through here.
//
// A character is printable unless it is a control character, changes the direction of text,
// separates lines or paragraphs, or marks bytes or annotations. A byte that is not part of UTF-8 is
// not printable.

/// A character of UTF-8, or a byte that is no part of it.
struct Utf8Character {
  std::size_t size = 1;  ///< in bytes
  bool valid = false;    ///< well-formed UTF-8 (Unicode 15, table 3-7)
  char32_t code = 0;
};

/// The first character of `text`, which must not be empty.
Utf8Character firstCharacter(std::string_view text);

bool isPrintable(const Utf8Character& character);

/// Whether all characters of `text` are printable.
bool isPrintable(std::string_view text);

/// Returns `text` as one line without effect on a terminal. Line breaks, tabs and carriage returns
/// become `\n`, `\t` and `\r`; each byte of any other character that is not printable becomes
/// `\xNN`. A shell reads the same escapes in `$'...'`.
std::string printable(std::string_view text);

/// The same for a text of several lines: line breaks and tabs stay.
std::string printableLines(std::string_view text);

/// Returns `text` as valid UTF-8: bytes that are not part of UTF-8 become `\xNN`, everything else
/// stays.
std::string validUtf8(std::string_view text);

/// Returns `text`, cut after about `longest` bytes. The number of all bytes is stated where it is
/// cut.
std::string shortened(std::string_view text, std::size_t longest);

}  // namespace vdbdither
