// The JSON Canonicalization Scheme of RFC 8785.

#include "io/stack/canonical_json.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

namespace vdbdither {

namespace {

using nlohmann::ordered_json;
using Take = std::function<void(std::string_view)>;

/// Hands text on in pieces that are worth a call.
class Writer {
 public:
  explicit Writer(const Take& take) : take_(take) {}

  void add(std::string_view text) {
    constexpr std::size_t enough = std::size_t{1} << 16;
    buffer_ += text;
    if (buffer_.size() >= enough) flush();
  }

  /// Section 3.2.2.2.
  void addString(std::string_view text) {
    buffer_ += '"';
    for (const char c : text) {
      constexpr std::string_view special = "\b\f\n\r\t\"\\";
      constexpr std::string_view letters = "bfnrt\"\\";
      if (static_cast<unsigned char>(c) >= 0x20 && c != '"' && c != '\\') {
        buffer_ += c;
      } else if (const std::size_t at = special.find(c); at != special.npos) {
        buffer_.append({'\\', letters[at]});
      } else {
        std::array<char, 8> code{};
        std::snprintf(code.data(), code.size(), "\\u%04x", static_cast<unsigned>(c));
        buffer_ += code.data();
      }
    }
    add("\"");
  }

  void flush() {
    take_(buffer_);
    buffer_.clear();
  }

 private:
  const Take& take_;
  std::string buffer_;
};

/// Section 3.2.2.3: Number::toString of ECMAScript.
std::string numberText(double value) {
  if (value == 0) return "0";
  std::array<char, 40> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), std::abs(value),
                                 std::chars_format::scientific)
                       .ptr;
  const std::string_view shortest(buffer.data(), static_cast<std::size_t>(end - buffer.data()));
  const std::size_t e = shortest.find('e');
  std::string digits(shortest.substr(0, e));
  if (digits.size() > 1) digits.erase(1, 1);
  // The decimal point follows after so many digits.
  const int point = std::stoi(std::string(shortest.substr(e + 1))) + 1;
  const int count = static_cast<int>(digits.size());
  const auto zeros = [](int number) { return std::string(static_cast<std::size_t>(number), '0'); };
  constexpr int most_zeros_in_front = 6;
  constexpr int most_before_point = 21;
  std::string text = digits;
  if (point > most_before_point || point <= -most_zeros_in_front) {
    if (count > 1) text.insert(1, ".");
    text += (point > 0 ? "e+" : "e-") + std::to_string(std::abs(point - 1));
  } else if (point >= count) {
    text += zeros(point - count);
  } else if (point > 0) {
    text.insert(static_cast<std::size_t>(point), ".");
  } else {
    text = "0." + zeros(-point) + digits;
  }
  return value < 0 ? "-" + text : text;
}

/// Section 3.2.3 sorts keys by their units in UTF-16, where characters beyond U+FFFF come before
/// those from U+E000 on.
bool isBefore(const std::string& a, const std::string& b) {
  const auto place = [](char c) {
    const auto byte = static_cast<std::uint8_t>(c);
    return byte >= 0xf0 ? 0xed00 + byte : byte << 8;
  };
  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end(),
                                      [&](char x, char y) { return place(x) < place(y); });
}

void write(const ordered_json& json, Writer& writer, std::string_view omitted = {}) {
  bool is_first = true;
  const auto separate = [&] {
    if (!std::exchange(is_first, false)) writer.add(",");
  };
  switch (json.type()) {
    case ordered_json::value_t::object: {
      std::vector<ordered_json::const_iterator> members;
      for (auto member = json.begin(); member != json.end(); ++member) {
        if (omitted.empty() || member.key() != omitted) members.push_back(member);
      }
      std::sort(members.begin(), members.end(),
                [](const auto& a, const auto& b) { return isBefore(a.key(), b.key()); });
      writer.add("{");
      for (const auto& member : members) {
        separate();
        writer.addString(member.key());
        writer.add(":");
        write(member.value(), writer);
      }
      writer.add("}");
      break;
    }
    case ordered_json::value_t::array:
      writer.add("[");
      for (const ordered_json& value : json) {
        separate();
        write(value, writer);
      }
      writer.add("]");
      break;
    case ordered_json::value_t::string:
      writer.addString(json.get_ref<const std::string&>());
      break;
    case ordered_json::value_t::number_integer:
    case ordered_json::value_t::number_unsigned:
    case ordered_json::value_t::number_float:
      writer.add(numberText(json.get<double>()));
      break;
    case ordered_json::value_t::boolean:
      writer.add(json.get<bool>() ? "true" : "false");
      break;
    default:
      writer.add("null");
  }
}

}  // namespace

void writeCanonically(const ordered_json& json, const Take& take, std::string_view omitted) {
  Writer writer(take);
  write(json, writer, omitted);
  writer.flush();
}

}  // namespace vdbdither
