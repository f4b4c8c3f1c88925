#pragma once

#include <filesystem>
#include <vector>

namespace vdbdither {

/// Notes that the process reads a file, so that a job can tell later whether it is still the same.
/// Safe to call from many threads.
void noteFileRead(const std::filesystem::path& path);

/// The files that were noted, each once, in order of their paths.
std::vector<std::filesystem::path> filesRead();

}  // namespace vdbdither
