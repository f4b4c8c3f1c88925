#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace vdbdither {

/// The end of the name of a folder that is put aside while another one takes its place.
inline constexpr std::string_view put_aside = ".old";

/// Returns the hidden path at which this process writes what will be `target`. Its name is short
/// enough for every file system, whatever the length of the name of the target.
std::filesystem::path stagingPath(const std::filesystem::path& target);

/// What the name of a file tells that a process made while it wrote a target.
struct StagingName {
  bool abandoned = false;  ///< no other process can need it: made here, by a process that has ended
  bool is_put_aside = false;
};

/// Returns nothing for a name that `stagingPath(target)` makes in no process.
std::optional<StagingName> parseStagingName(const std::filesystem::path& target,
                                            const std::string& name);

}  // namespace vdbdither
