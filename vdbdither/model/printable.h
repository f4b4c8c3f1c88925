#pragma once

#include <string>
#include <string_view>

namespace vdbdither {

// Names and texts of files can hold any bytes. What is shown to the user passes through here.
//
// A character is printable unless it is a control character, changes the direction of text, or
// separates lines or paragraphs. A byte that is not part of UTF-8 is not printable.

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
