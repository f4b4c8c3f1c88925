// URIs: RFC 3986, "Uniform Resource Identifier (URI): Generic Syntax", 2005, and RFC 2397, "The
// 'data' URL scheme", 1998. Base64: RFC 4648, 2006.

#include "io/mesh/gltf_uri.h"

#include <array>
#include <cctype>

#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string percentDecoded(std::string_view text) {
  std::string decoded;
  decoded.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    const int high = text[i] == '%' && i + 2 < text.size() ? hexDigit(text[i + 1]) : -1;
    const int low = high >= 0 ? hexDigit(text[i + 2]) : -1;
    if (low < 0) {
      decoded.push_back(text[i]);
      continue;
    }
    decoded.push_back(static_cast<char>(16 * high + low));
    i += 2;
  }
  return decoded;
}

constexpr std::uint8_t no_digit = 64;

constexpr std::array<std::uint8_t, 256> base64Digits() {
  std::array<std::uint8_t, 256> digits{};
  for (std::uint8_t& digit : digits) digit = no_digit;
  constexpr std::string_view alphabet =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < alphabet.size(); ++i)
    digits[static_cast<unsigned char>(alphabet[i])] = static_cast<std::uint8_t>(i);
  return digits;
}

/// Returns nothing for a text that is no Base64. Its padding may be missing.
std::optional<std::vector<std::uint8_t>> decodeBase64(std::string_view text) {
  static constexpr std::array<std::uint8_t, 256> digits = base64Digits();
  for (int i = 0; i < 2 && text.ends_with('='); ++i) text.remove_suffix(1);
  if (text.size() % 4 == 1) return std::nullopt;
  std::vector<std::uint8_t> bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  std::uint32_t bits = 0;
  int bit_count = 0;
  for (const char c : text) {
    const std::uint8_t digit = digits[static_cast<unsigned char>(c)];
    if (digit == no_digit) return std::nullopt;
    bits = (bits << 6 | digit) & 0xFFFF;
    bit_count += 6;
    if (bit_count < 8) continue;
    bit_count -= 8;
    bytes.push_back(static_cast<std::uint8_t>(bits >> bit_count));
  }
  return bytes;
}

/// Returns the scheme of a URI, empty for a relative one. A single letter is a drive.
std::string_view schemeOf(std::string_view uri) {
  const std::size_t colon = uri.find_first_of(":/\\?#");
  if (colon == std::string_view::npos || colon < 2 || uri[colon] != ':') return {};
  return uri.substr(0, colon);
}

}  // namespace

std::optional<std::vector<std::uint8_t>> decodeDataUri(const MeshFile& file,
                                                       const std::string& shown,
                                                       std::string_view uri) {
  if (!equalsIgnoringCase(schemeOf(uri), "data")) return std::nullopt;
  const std::size_t comma = uri.find(',');
  if (comma == std::string_view::npos || !uri.substr(0, comma).ends_with(";base64"))
    file.refuse(shown + ": its data are not in Base64; export the file again");
  auto bytes = decodeBase64(uri.substr(comma + 1));
  if (!bytes) file.refuse(shown + ": its Base64 data are damaged; export the file again");
  return bytes;
}

std::string pathOfUri(const MeshFile& file, std::string_view kind, std::string_view uri) {
  if (!schemeOf(uri).empty()) {
    file.refuse(std::string(kind) + " " + inQuotes(uri) +
                " is not a file in the folder of the mesh; put it there and name it by a relative "
                "path");
  }
  return percentDecoded(uri);
}

}  // namespace vdbdither
