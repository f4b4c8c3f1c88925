#pragma once

#include <filesystem>
#include <vector>

namespace vdbdither {

/// Notes that the process reads a file, so that a job can tell later whether it is still the same.
/// Safe to call from many threads.
void noteFileRead(const std::filesystem::path& path);

/// While it exists, reads of this thread are not noted: those of an old output, which tell only
/// whether it may be replaced.
class ReadsUnnoted {
 public:
  ReadsUnnoted();
  ReadsUnnoted(const ReadsUnnoted&) = delete;
  ReadsUnnoted& operator=(const ReadsUnnoted&) = delete;
  ~ReadsUnnoted();
};

/// The files that were noted, each once, in order of their paths.
std::vector<std::filesystem::path> filesRead();

}  // namespace vdbdither
