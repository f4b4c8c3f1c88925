#include "io/file/key_values.h"

#include <charconv>
#include <cmath>
#include <utility>

#include "vdbdither/engine/option_values.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

KeyValues::KeyValues(std::span<const std::uint8_t> bytes, std::string shown)
    : shown_(std::move(shown)) {
  std::string_view rest(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (int number = 1; !rest.empty(); ++number) {
    const std::size_t size = rest.find('\n');
    const std::string_view line = trimmed(rest.substr(0, size));
    rest.remove_prefix(size == rest.npos ? rest.size() : size + 1);
    if (line.empty() || std::string_view("#;[").find(line.front()) != std::string_view::npos)
      continue;
    const std::size_t equals = line.find('=');
    const std::string where = shown_ + ", line " + std::to_string(number) + ": ";
    if (equals == line.npos || equals == 0) throw DataError(where + "is not 'key = value'");
    const std::string key(trimmed(line.substr(0, equals)));
    if (!values_.try_emplace(key, trimmed(line.substr(equals + 1))).second)
      throw DataError(where + "'" + printable(key) + "' is there twice");
  }
}

std::optional<std::string> KeyValues::find(const std::string& key) const {
  const auto entry = values_.find(key);
  return entry == values_.end() ? std::nullopt : std::optional(entry->second);
}

std::string KeyValues::text(const std::string& key) const {
  if (const auto value = find(key)) return *value;
  throw DataError(shown_ + ": '" + key + "' is missing");
}

double KeyValues::number(const std::string& key, double least, double most) const {
  const std::string value = text(key);
  double number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc() || end != value.data() + value.size() ||
      !(number >= least && number <= most)) {
    throw DataError(shown_ + ": '" + key + "' must be a number from " + shortestText(least) +
                    " to " + shortestText(most) + ", not '" + printable(value) + "'");
  }
  return number;
}

int KeyValues::integer(const std::string& key, int least, int most) const {
  const double value = number(key, least, most);
  if (value != std::floor(value))
    throw DataError(shown_ + ": '" + key + "' must be a whole number");
  return static_cast<int>(value);
}

}  // namespace vdbdither
