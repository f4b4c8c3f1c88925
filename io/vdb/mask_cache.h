#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include <openvdb/openvdb.h>

namespace vdbdither {

/// Where masks are kept for the next run: `vdbdither/masks` in $XDG_CACHE_HOME, or in ~/.cache
/// where that is not set. None where neither is an absolute path (XDG Base Directory Specification
/// 0.8).
std::optional<std::filesystem::path> maskCacheFolder();

/// The mask that the metadata of `described` tell of: out of the cache folder, or as `make` gives
/// it, which is kept there from then on. A file appears whole or not at all.
///
/// A kept file that is damaged (its digest does not fit) or described otherwise is made anew.
/// Trouble with the cache goes to `warn`, a line each, and does not keep the mask from being made.
openvdb::FloatGrid::ConstPtr cachedMask(const openvdb::FloatGrid& described,
                                        const std::function<openvdb::FloatGrid::ConstPtr()>& make,
                                        const std::function<void(const std::string&)>& warn);

}  // namespace vdbdither
