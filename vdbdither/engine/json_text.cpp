#include "vdbdither/engine/json_text.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
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

/// More levels are refused.
constexpr int deepest_level = 100;

/// Where the brackets of `text` that are open at once become too many, or its end.
std::size_t endOfLevels(std::string_view text) {
  int depth = 0;
  bool in_string = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (in_string && c == '\\') {
      ++at;
    } else if (c == '"') {
      in_string = !in_string;
    } else if (!in_string && (c == '[' || c == '{')) {
      if (++depth > deepest_level) return at;
    } else if (!in_string && (c == ']' || c == '}')) {
      --depth;
    }
  }
  return text.size();
}

/// Notes the first mistake of a text, and nothing else, however long the text is.
class Mistake : public nlohmann::json_sax<ordered_json> {
 public:
  std::optional<std::size_t> at{};  ///< the byte, from 0
  std::string message{};

  bool null() override { return true; }
  bool boolean(bool /*value*/) override { return true; }
  bool number_integer(number_integer_t /*value*/) override { return true; }
  bool number_unsigned(number_unsigned_t /*value*/) override { return true; }
  bool number_float(number_float_t /*value*/, const string_t& /*text*/) override { return true; }
  bool string(string_t& /*text*/) override { return true; }
  bool binary(binary_t& /*bytes*/) override { return true; }
  bool key(string_t& /*text*/) override { return true; }
  bool start_object(std::size_t /*size*/) override { return true; }
  bool start_array(std::size_t /*size*/) override { return true; }
  bool end_object() override { return true; }
  bool end_array() override { return true; }

  bool parse_error(std::size_t position, const std::string& token,
                   const ordered_json::exception& error) override {
    constexpr int number_out_of_range = 406;
    at = position > 0 ? position - 1 : 0;
    if (error.id == number_out_of_range) {
      at = position - std::min(position, token.size());
      message = "the number " + shortened(token, 40) + " is too large";
      return false;
    }
    // "[json.exception.parse_error.101] parse error at line 1, column 2: syntax error …"
    const std::string what = error.what();
    const std::size_t said = what.find(": ");
    message = "this is not JSON: " + (said == what.npos ? what : what.substr(said + 2));
    return false;
  }
};

/// Returns that `text` is refused for what is at the byte `at`.
std::string problemAt(std::string_view text, std::size_t at, const std::string& what) {
  const std::string_view before = text.substr(0, at);
  const auto line = std::count(before.begin(), before.end(), '\n') + 1;
  const std::size_t line_begin = before.rfind('\n') + 1;  // 0 where there is none
  return "line " + std::to_string(line) + ", column " +
         std::to_string(before.size() - line_begin + 1) + ": " + what;
}

}  // namespace

std::string jsonText(ordered_json json, int indent) {
  return escaped(withValidTexts(std::move(json)).dump(indent));
}

ordered_json parsedJson(std::string_view text) {
  // To the parser a zero byte is the end of the text, whatever follows it.
  if (endOfLevels(text) < text.size() || text.find('\0') != std::string_view::npos)
    return ordered_json::value_t::discarded;
  return ordered_json::parse(text, nullptr, false);
}

std::string jsonProblem(std::string_view text) {
  if (const std::size_t end = endOfLevels(text); end < text.size()) {
    return problemAt(text, end,
                     "the text nests deeper than " + std::to_string(deepest_level) + " levels");
  }
  Mistake mistake;
  ordered_json::sax_parse(text, &mistake);
  if (mistake.at) return problemAt(text, *mistake.at, mistake.message);
  const std::size_t zero = text.find('\0');
  return zero == text.npos ? "" : problemAt(text, zero, "this is not JSON: a zero byte");
}

}  // namespace vdbdither
