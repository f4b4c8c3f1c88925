#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace vdbdither {

/// A value of a JSON text.
struct JsonPlace {
  int line = 1;  ///< from 1, of its key, or of the value where it has none
  std::map<std::string, JsonPlace, std::less<>> parts;  ///< members by key, elements by index
};

/// Where the values of a JSON text stand.
struct JsonLines {
  JsonPlace root;
  std::vector<std::pair<int, std::string>> repeated;  ///< keys that their object holds twice

  /// The line of the value that `path` leads to, keys and indices, or of the innermost value on its
  /// way that is there.
  [[nodiscard]] int of(std::span<const std::string> path) const;
};

/// \param text  JSON, no deeper than parsedJson accepts
JsonLines jsonLines(std::string_view text);

}  // namespace vdbdither
