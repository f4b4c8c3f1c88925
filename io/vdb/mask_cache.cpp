#include "io/vdb/mask_cache.h"

#include <cstdlib>
#include <sstream>

#include "io/file/digest.h"
#include "io/file/staged_output.h"
#include "io/vdb/vdb.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace fs = std::filesystem;
using openvdb::FloatGrid;

namespace {

std::optional<fs::path> folderOf(const char* variable) {
  const char* text = std::getenv(variable);
  if (!text || !fs::path(text).is_absolute()) return std::nullopt;
  return text;
}

/// Other metadata, another name.
std::string fileName(const FloatGrid& described) {
  std::ostringstream text;
  for (auto entry = described.beginMeta(); entry != described.endMeta(); ++entry) {
    text << entry->first << '=';
    entry->second->write(text);
  }
  const std::string bytes = text.str();
  Digest digest;
  digest.update(bytes.data(), bytes.size());
  return hexText(digest.finish()).substr(0, 16) + ".vdb";
}

bool isAsDescribed(const FloatGrid& mask, const FloatGrid& described) {
  for (auto entry = described.beginMeta(); entry != described.endMeta(); ++entry) {
    const openvdb::Metadata::ConstPtr found = mask[entry->first];
    if (!found || *found != *entry->second) return false;
  }
  return true;
}

FloatGrid::ConstPtr kept(const fs::path& path, const FloatGrid& described) {
  auto mask = openvdb::gridConstPtrCast<FloatGrid>(readGrid(path, mask_grid));
  if (!mask || !isAsDescribed(*mask, described))
    throw DataError("'" + path.string() + "' holds another mask than its name says");
  return mask;
}

void keep(const fs::path& path, const FloatGrid::ConstPtr& mask) {
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  if (error) {
    throw DataError("cannot make the folder '" + path.parent_path().string() +
                    "': " + error.message());
  }
  StagedOutput output(path, StagedOutput::Kind::file);
  VdbContents contents;
  contents.grids[mask_grid] = mask;
  writeVdb(output.path(), contents, VdbCodec::blosc, path);
  output.commit();
}

}  // namespace

std::optional<fs::path> maskCacheFolder() {
  if (const auto cache = folderOf("XDG_CACHE_HOME")) return *cache / "vdbdither" / "masks";
  std::error_code none;
  if (const auto home = folderOf("HOME"); home && fs::is_directory(*home, none))
    return *home / ".cache" / "vdbdither" / "masks";
  return std::nullopt;
}

FloatGrid::ConstPtr cachedMask(const FloatGrid& described,
                               const std::function<FloatGrid::ConstPtr()>& make,
                               const std::function<void(const std::string&)>& warn) {
  const std::optional<fs::path> folder = maskCacheFolder();
  if (!folder) {
    warn("the mask is made anew in every run: neither XDG_CACHE_HOME nor HOME names a folder");
    return make();
  }
  const fs::path path = *folder / fileName(described);
  std::error_code none;
  if (fs::exists(path, none)) {
    try {
      return kept(path, described);
    } catch (const DataError& error) {
      warn(std::string(error.what()) + "; it is made again");
    }
  }
  FloatGrid::ConstPtr mask = make();
  try {
    keep(path, mask);
  } catch (const DataError& error) {
    warn(std::string("the mask is not kept for the next run: ") + error.what());
  }
  return mask;
}

}  // namespace vdbdither
