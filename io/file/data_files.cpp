#include "io/file/data_files.h"

#include <cstdlib>

namespace vdbdither {

namespace fs = std::filesystem;

std::vector<fs::path> dataFolders() {
  std::vector<fs::path> folders;
  if (const char* folder = std::getenv("VDBDITHER_DATA")) folders.emplace_back(folder);
  std::error_code none;
  const fs::path program = fs::read_symlink("/proc/self/exe", none);
  if (!none) {
    const fs::path bin = program.parent_path();
    folders.push_back(bin.parent_path() / "share" / "vdbdither");
    // A build tree keeps its data beside the program, whose tests run one folder below it.
    folders.push_back(bin / "share");
    folders.push_back(bin.parent_path() / "share");
  }
  return folders;
}

std::optional<fs::path> findDataFile(const std::string& name) {
  for (const fs::path& folder : dataFolders()) {
    std::error_code none;
    if (fs::is_regular_file(folder / name, none)) return folder / name;
  }
  return std::nullopt;
}

}  // namespace vdbdither
