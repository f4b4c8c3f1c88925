#include "vdbdither/engine/json_text.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <string_view>

#include <nlohmann/json.hpp>

#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;

ordered_json withValidTexts(ordered_json json) {
  if (json.is_string()) return validUtf8(json.get_ref<const std::string&>());
  if (json.is_array()) {
    for (ordered_json& entry : json) entry = withValidTexts(std::move(entry));
  } else if (json.is_object()) {
    ordered_json result = ordered_json::object();
    for (auto& [key, value] : json.items()) result[validUtf8(key)] = withValidTexts(value);
    return result;
  }
  return json;
}

/// Writes the characters beyond ASCII that are not printable as JSON escapes. The library does so
/// for those of ASCII only.
std::string escaped(const std::string& text) {
  std::string result;
  result.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    const auto byte = static_cast<unsigned char>(text[at]);
    const std::size_t size = byte < 0x80 ? 1 : byte < 0xE0 ? 2 : byte < 0xF0 ? 3 : 4;
    const std::string_view character = std::string_view(text).substr(at, size);
    at += size;
    if (byte != 0x7F && (size == 1 || size == 4 || isPrintable(character))) {
      result += character;
      continue;
    }
    unsigned code = size == 1 ? byte : byte & (0x7FU >> size);
    for (const char c : character.substr(1))
      code = code << 6 | (static_cast<unsigned char>(c) & 0x3FU);
    std::array<char, 8> digits{};
    std::snprintf(digits.data(), digits.size(), "\\u%04x", code);
    result += digits.data();
  }
  return result;
}

/// The brackets of `text` that are open at once, at most.
int depthOf(std::string_view text) {
  int depth = 0;
  int deepest = 0;
  bool in_string = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (in_string && c == '\\') {
      ++at;
    } else if (c == '"') {
      in_string = !in_string;
    } else if (!in_string && (c == '[' || c == '{')) {
      deepest = std::max(deepest, ++depth);
    } else if (!in_string && (c == ']' || c == '}')) {
      --depth;
    }
  }
  return deepest;
}

}  // namespace

std::string jsonText(ordered_json json, int indent) {
  return escaped(withValidTexts(std::move(json)).dump(indent));
}

ordered_json parsedJson(std::string_view text) {
  constexpr int deepest = 100;
  if (depthOf(text) > deepest) return ordered_json::value_t::discarded;
  return ordered_json::parse(text, nullptr, false);
}

}  // namespace vdbdither
