#include "io/file/file_name.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <iterator>

#include "vdbdither/model/printable.h"

namespace vdbdither {

std::optional<std::string> fileNameProblem(std::string_view name) {
  if (name.empty()) return "is empty";
  if (name == "." || name == "..") return "is '" + std::string(name) + "'";
  if (name.size() > longest_file_name) {
    return "has " + std::to_string(name.size()) + " bytes; the maximum is " +
           std::to_string(longest_file_name);
  }
  while (!name.empty()) {
    const Utf8Character character = firstCharacter(name);
    if (!character.valid) return "is not UTF-8";
    if (character.code == '/' || character.code == '\\')
      return std::string("contains '") + static_cast<char>(character.code) + "'";
    if (!isPrintable(character)) {
      std::array<char, 16> code{};
      std::snprintf(code.data(), code.size(), "U+%04X", static_cast<unsigned>(character.code));
      return std::string("contains the unprintable character ") + code.data();
    }
    name.remove_prefix(character.size);
  }
  return std::nullopt;
}

std::optional<std::string> relativePathProblem(std::string_view path) {
  if (path.starts_with('/')) return "is an absolute path";
  for (;;) {
    const std::size_t slash = path.find('/');
    if (auto problem = fileNameProblem(path.substr(0, slash))) {
      return slash == path.npos ? problem : "has a folder whose name " + *problem;
    }
    if (slash == path.npos) return std::nullopt;
    path.remove_prefix(slash + 1);
  }
}

bool liesWithin(const std::filesystem::path& path, const std::filesystem::path& folder) {
  // Both end with an empty name, which tells /job from /jobs.
  const auto whole = [](const std::filesystem::path& name) {
    return std::filesystem::absolute(name / "").lexically_normal();
  };
  const std::filesystem::path outer = whole(folder);
  const std::filesystem::path inner = whole(path);
  const auto end = std::prev(outer.end());
  return std::mismatch(outer.begin(), end, inner.begin(), inner.end()).first == end;
}

}  // namespace vdbdither
