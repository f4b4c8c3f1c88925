#include "io/profile/json_lines.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include <nlohmann/json.hpp>

namespace vdbdither {

using nlohmann::ordered_json;

namespace {

/// An object or list that is open.
struct Open {
  JsonPlace* place = nullptr;
  bool is_object = false;
  bool awaits_key = false;
  std::size_t index = 0;        ///< of the element of a list
  JsonPlace* member = nullptr;  ///< the value of an object whose key was read
};

/// The end of the string that begins at `begin`, behind its quotation mark.
std::size_t endOfString(std::string_view text, std::size_t begin) {
  std::size_t at = begin + 1;
  while (at < text.size() && text[at] != '"') at += text[at] == '\\' ? 2 : 1;
  return std::min(at + 1, text.size());
}

/// Where the value that begins on `line` belongs.
JsonPlace& placeOf(JsonLines& lines, std::vector<Open>& open, int line) {
  if (open.empty()) {
    lines.root.line = line;
    return lines.root;
  }
  Open& holder = open.back();
  if (holder.is_object) return *holder.member;
  JsonPlace& place = holder.place->parts[std::to_string(holder.index)];
  place.line = line;
  return place;
}

void noteKey(JsonLines& lines, Open& object, std::string_view token, int line) {
  const auto key = ordered_json::parse(token).get<std::string>();
  const auto [entry, is_new] = object.place->parts.try_emplace(key);
  if (!is_new) lines.repeated.emplace_back(line, key);
  entry->second.line = line;
  object.member = &entry->second;
  object.awaits_key = false;
}

}  // namespace

int JsonLines::of(std::span<const std::string> path) const {
  const JsonPlace* place = &root;
  for (const std::string& step : path) {
    const auto part = place->parts.find(step);
    if (part == place->parts.end()) break;
    place = &part->second;
  }
  return place->line;
}

JsonLines jsonLines(std::string_view text) {
  JsonLines lines;
  std::vector<Open> open;
  int line = 1;
  bool in_word = false;  // a number, true, false or null
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    const bool is_word = std::string_view(" \t\r\n,:{}[]\"").find(c) == std::string_view::npos;
    if (is_word && !in_word) placeOf(lines, open, line);
    in_word = is_word;
    if (c == '\n') {
      ++line;
    } else if (c == '"') {
      const std::size_t end = endOfString(text, at);
      if (!open.empty() && open.back().awaits_key) {
        noteKey(lines, open.back(), text.substr(at, end - at), line);
      } else {
        placeOf(lines, open, line);
      }
      at = end - 1;
    } else if (c == '{' || c == '[') {
      open.push_back({&placeOf(lines, open, line), c == '{', c == '{'});
    } else if (c == '}' || c == ']') {
      open.pop_back();
    } else if (c == ',') {
      ++open.back().index;
      open.back().awaits_key = open.back().is_object;
    }
  }
  return lines;
}

}  // namespace vdbdither
