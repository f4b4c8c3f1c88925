#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace vdbdither {

// The one rule for names that come out of a file (of materials, printers, slices, members of an
// archive) before the file system sees them.

/// The maximum length of the name of a file, in bytes.
inline constexpr std::size_t longest_file_name = 255;

/// Returns why `name` cannot name a file or folder, in words that continue "the name …", or nothing
/// if it can. A name is a single component of a path: 1 to 255 bytes of UTF-8 without `/`, `\` and
/// characters that do not print, and neither `.` nor `..`.
std::optional<std::string> fileNameProblem(std::string_view name);

/// The same for a path below a folder: names with a `/` between them.
std::optional<std::string> relativePathProblem(std::string_view path);

/// Whether `path` is `folder` or leads into it, by their names: neither need exist.
bool liesWithin(const std::filesystem::path& path, const std::filesystem::path& folder);

}  // namespace vdbdither
