#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace vdbdither {

/// A text of lines `key = value`, as configurations of slicers are. Blank lines and lines that
/// begin with `#`, `;` or `[` are passed over.
class KeyValues {
 public:
  /// @param shown  what messages call the file: its name in quotes
  /// Throws DataError for any other line, and for a key with two values.
  KeyValues(std::span<const std::uint8_t> bytes, std::string shown);

  [[nodiscard]] std::optional<std::string> find(const std::string& key) const;
  /// Returns a value that is there. Throws DataError.
  [[nodiscard]] std::string text(const std::string& key) const;
  /// Returns a number from `least` to `most`. Throws DataError.
  [[nodiscard]] double number(const std::string& key, double least, double most) const;
  /// The same of a whole number.
  [[nodiscard]] int integer(const std::string& key, int least, int most) const;

 private:
  std::string shown_;
  std::map<std::string, std::string> values_;
};

}  // namespace vdbdither
