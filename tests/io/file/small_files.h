#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "io/file/staged_output.h"

namespace vdbdither::test {

inline const std::vector<std::uint8_t> one = {1};
inline const std::vector<std::uint8_t> two = {2, 2};

inline void put(const std::filesystem::path& path, const std::vector<std::uint8_t>& bytes) {
  writeFile(path, bytes, path);
}

/// An output that wrote `old` and `white/old` before.
inline std::set<std::string> ownFiles(const std::filesystem::path& /*folder*/) {
  return {"old", "white/old"};
}

}  // namespace vdbdither::test
