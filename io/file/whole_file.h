#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace vdbdither {

/// Returns the bytes of an ordinary file. A pipe or a device is refused without waiting for it, and
/// a file of more than `most_bytes` before it is read. Throws DataError.
/// @param shown  what messages call the file, as in "cannot read SHOWN: …"
std::vector<std::uint8_t> readWholeFile(const std::filesystem::path& path, const std::string& shown,
                                        std::uint64_t most_bytes);

/// The refusal of a file that is larger than it can be.
std::string tooLarge(const std::string& shown, std::uint64_t bytes, std::uint64_t most_bytes);

}  // namespace vdbdither
