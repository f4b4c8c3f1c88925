#include "io/file/files_read.h"

#include <mutex>
#include <set>

namespace vdbdither {

namespace {

struct FilesRead {
  std::mutex mutex;
  std::set<std::filesystem::path> paths;

  /// Never destroyed, because threads may read while the process ends.
  static FilesRead& all() {
    static auto* const files = new FilesRead;
    return *files;
  }
};

thread_local int unnoted = 0;

}  // namespace

ReadsUnnoted::ReadsUnnoted() { ++unnoted; }

ReadsUnnoted::~ReadsUnnoted() { --unnoted; }

void noteFileRead(const std::filesystem::path& path) {
  if (unnoted > 0) return;
  FilesRead& files = FilesRead::all();
  const std::lock_guard lock(files.mutex);
  files.paths.insert(path.lexically_normal());
}

std::vector<std::filesystem::path> filesRead() {
  FilesRead& files = FilesRead::all();
  const std::lock_guard lock(files.mutex);
  return {files.paths.begin(), files.paths.end()};
}

}  // namespace vdbdither
