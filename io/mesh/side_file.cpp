#include "io/mesh/side_file.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <system_error>

#include "io/file/file_name.h"
#include "io/file/whole_file.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace fs = std::filesystem;

namespace {

/// Without components that change nothing ("./", "//") and with those of ".." resolved as far as
/// they stay within the path.
std::string normalized(std::string_view path) {
  std::string text(path);
  std::replace(text.begin(), text.end(), '\\', '/');
  const bool absolute = text.starts_with('/');
  const std::string relative = fs::path(text).lexically_normal().relative_path().generic_string();
  return absolute ? "/" + relative : relative;
}

/// The only entry of its folder that has this name but for upper and lower case, which some systems
/// do not tell apart.
std::optional<fs::path> inOtherCase(const fs::path& path) {
  const std::string name = lowerCase(path.filename().string());
  std::error_code error;
  std::optional<fs::path> found;
  for (fs::directory_iterator entry(path.parent_path(), error), end; !error && entry != end;
       entry.increment(error)) {
    if (!equalsIgnoringCase(entry->path().filename().string(), name)) continue;
    if (found) return std::nullopt;
    found = entry->path();
  }
  return found;
}

/// Returns the file's real path if it exists, and whether it lies in `folder`.
struct Found {
  fs::path path;
  bool within;
};
std::optional<Found> find(const fs::path& folder, const std::string& name) {
  std::error_code error;
  fs::path path = fs::canonical(folder / name, error);
  if (error) {
    const auto other = inOtherCase(folder / name);
    if (!other) return std::nullopt;
    path = fs::canonical(*other, error);
    if (error) return std::nullopt;
  }
  const fs::path real_folder = fs::canonical(folder, error);
  if (error) return std::nullopt;
  const auto [end, rest] =
      std::mismatch(real_folder.begin(), real_folder.end(), path.begin(), path.end());
  return Found{path, end == real_folder.end()};
}

std::optional<Found> findFor(const MeshFile& file, const std::string& name) {
  fs::path folder = fs::path(file.name()).parent_path();
  if (folder.empty()) folder = ".";
  const std::string last = name.substr(name.rfind('/') + 1);
  std::optional<Found> found;
  if (!relativePathProblem(name)) found = find(folder, name);
  if (!found && last != name) found = find(folder, last);
  return found;
}

}  // namespace

SideFile readSideFile(const MeshFile& file, std::string_view kind, std::string_view path,
                      std::uint64_t most_bytes) {
  const std::string shown = std::string(kind) + " " + inQuotes(path);
  const std::string name = normalized(path);
  const std::string last = name.substr(name.rfind('/') + 1);
  if (const auto problem = fileNameProblem(last)) file.refuse(shown + ": the name " + *problem);
  const std::optional<Found> found = findFor(file, name);
  if (!found) {
    file.refuse(shown + (relativePathProblem(name) && name.starts_with("..")
                             ? " lies outside of the folder of the mesh; move it there"
                             : ": no such file in the folder of the mesh; put it there"));
  }
  if (!found->within)
    file.refuse(shown + " leads outside of the folder of the mesh; copy the file there");
  try {
    return {shown, readWholeFile(found->path, shown, most_bytes)};
  } catch (const DataError& error) {
    file.refuse(error.what());
  }
}

bool hasSideFile(const MeshFile& file, std::string_view path) {
  const std::string name = normalized(path);
  if (fileNameProblem(name.substr(name.rfind('/') + 1))) return false;
  const std::optional<Found> found = findFor(file, name);
  std::error_code error;
  return found && found->within && fs::is_regular_file(found->path, error);
}

}  // namespace vdbdither
