#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace vdbdither {

/// Where printer profiles and masks are looked for, first to last: $VDBDITHER_DATA, the
/// share/vdbdither folder beside the running program's bin folder, and the build tree that the
/// program was built in.
std::vector<std::filesystem::path> dataFolders();

/// The first data folder's file called `name` (`masks/blue.vdb`), if any has it.
std::optional<std::filesystem::path> findDataFile(const std::string& name);

}  // namespace vdbdither
