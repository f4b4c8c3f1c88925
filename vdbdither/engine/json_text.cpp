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
std::string escaped(std::string_view text) {
  constexpr char32_t del = 0x7F;
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const Utf8Character character = firstCharacter(text);
    if (character.code != del && (character.size == 1 || isPrintable(character))) {
      result += text.substr(0, character.size);
    } else {
      std::array<char, 16> digits{};
      std::snprintf(digits.data(), digits.size(), "\\u%04x", static_cast<unsigned>(character.code));
      result += digits.data();
    }
    text.remove_prefix(character.size);
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
  // To the parser a zero byte is the end of the text, whatever follows it.
  if (depthOf(text) > deepest || text.find('\0') != std::string_view::npos)
    return ordered_json::value_t::discarded;
  return ordered_json::parse(text, nullptr, false);
}

}  // namespace vdbdither
