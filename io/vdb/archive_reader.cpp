#include "io/vdb/archive_reader.h"

#include <cstring>
#include <ios>
#include <vector>

#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/io.h>
#include <openvdb/tools/ChangeBackground.h>

#include "io/vdb/archive_check.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

using openvdb::GridBase;
using openvdb::MetaMap;

namespace {

constexpr const char* without_volume =
    " has a transform without volume, or of numbers that are not finite";

/// Statistics that OpenVDB writes into a grid's metadata are of the file, not of the grid.
void dropFileStatistics(GridBase& grid) {
  std::vector<std::string> keys;
  for (auto entry = grid.beginMeta(); entry != grid.endMeta(); ++entry) {
    if (entry->first.starts_with("file_")) keys.push_back(entry->first);
  }
  for (const std::string& key : keys) grid.removeMeta(key);
}

/// A grid that was read from half floats is one of floats; whether it is written as such again is
/// another matter.
void dropHalf(GridBase& grid) {
  if (!grid.saveFloatAsHalf()) return;
  grid.setSaveFloatAsHalf(false);
  const auto background = grid.getMetadata<openvdb::FloatMetadata>(half_background_key);
  auto* numbers = dynamic_cast<openvdb::FloatGrid*>(&grid);
  if (background && numbers) openvdb::tools::changeBackground(numbers->tree(), background->value());
  grid.removeMeta(half_background_key);
}

/// Reads an archive that is checked (archive_check.h).
class ArchiveReader : private openvdb::io::Archive {
 public:
  ArchiveReader(std::istream& stream, std::uint64_t size, const std::string& where,
                const ArchiveLimits& limits)
      : stream_(stream), size_(size), where_(where), limits_(limits) {}

  VdbContents read() {
    // A read that comes up short must throw: OpenVDB would go on with whatever is in memory.
    stream_.exceptions(std::ios::badbit | std::ios::failbit);
    try {
      checkArchive(stream_, size_, where_, limits_, part_);
      readAll();
      for (const GridBase::Ptr& grid : grids_) checkTransform(*grid);
    } catch (const std::ios::failure&) {
      throw unreadableArchive(where_, "it ends too early");
    } catch (const openvdb::ArithmeticError&) {
      throw unreadableArchive(where_, part_ + without_volume);
    } catch (const openvdb::Exception&) {
      throw unreadableArchive(where_, part_ + " is damaged, or uses what OpenVDB " +
                                          OPENVDB_LIBRARY_VERSION_STRING + " does not know");
    } catch (const std::length_error&) {
      throw unreadableArchive(where_, part_ + " is damaged");
    }
    return collected();
  }

 private:
  void readAll() {
    part_ = "its header";
    readHeader(stream_);
    auto tags = std::make_shared<openvdb::io::StreamMetadata>();
    openvdb::io::setStreamMetadataPtr(stream_, tags, false);
    openvdb::io::setVersion(stream_, libraryVersion(), fileVersion());
    openvdb::io::setDataCompression(stream_, compression());
    part_ = "its metadata";
    metadata_.readMeta(stream_);
    std::uint32_t count = 0;
    stream_.read(reinterpret_cast<char*>(&count), sizeof count);
    NamedGridMap by_name;
    std::vector<openvdb::io::GridDescriptor> descriptors;
    for (std::uint32_t i = 0; i < count; ++i) readOne(i, by_name, descriptors);
    part_ = "a grid that shares its voxels with another";
    for (const auto& descriptor : descriptors) connectInstance(descriptor, by_name);
  }

  void readOne(std::uint32_t index, NamedGridMap& by_name,
               std::vector<openvdb::io::GridDescriptor>& descriptors) {
    part_ = "grid " + std::to_string(index + 1);
    openvdb::io::GridDescriptor descriptor;
    const GridBase::Ptr grid = descriptor.read(stream_);
    part_ = "grid '" + printable(descriptor.gridName()) + "'";
    if (descriptor.isInstance() || hasReadVoxels(descriptor.gridType())) {
      readGrid(grid, descriptor, stream_);
    } else {
      readGridCompression(stream_);
      grid->readMeta(stream_);
      grid->readTransform(stream_);
      stream_.seekg(descriptor.getEndPos());
    }
    by_name[descriptor.uniqueName()] = grid;
    descriptors.push_back(descriptor);
    grids_.push_back(grid);
  }

  void checkTransform(const GridBase& grid) {
    part_ = "grid '" + printable(grid.getName()) + "'";
    if (!grid.transform().isLinear()) return;
    const openvdb::Mat4d matrix = grid.transform().baseMap()->getAffineMap()->getMat4();
    if (!matrix.isFinite()) throw unreadableArchive(where_, part_ + without_volume);
  }

  VdbContents collected() {
    VdbContents contents;
    for (const GridBase::Ptr& grid : grids_) {
      dropFileStatistics(*grid);
      dropHalf(*grid);
      const std::string given = printable(grid->getName());
      std::string name = given;
      for (int copy = 2; contents.grids.contains(name); ++copy)
        name = given + "_" + std::to_string(copy);
      if (name != grid->getName()) grid->setName(name);
      contents.grids[name] = grid;
    }
    for (auto entry = metadata_.beginMeta(); entry != metadata_.endMeta(); ++entry)
      contents.metadata[printable(entry->first)] = entry->second->str();
    return contents;
  }

  std::istream& stream_;
  std::uint64_t size_;
  const std::string& where_;
  ArchiveLimits limits_;
  std::string part_;  ///< what is read now, for messages
  MetaMap metadata_;
  openvdb::GridPtrVec grids_;
};

}  // namespace

VdbContents readArchive(std::istream& stream, std::uint64_t size, const std::string& where,
                        const ArchiveLimits& limits) {
  return ArchiveReader(stream, size, where, limits).read();
}

std::string whatFollows(std::string_view begin, std::uint64_t size) {
  std::int32_t magic = 0;
  if (begin.size() >= sizeof magic) std::memcpy(&magic, begin.data(), sizeof magic);
  if (magic == openvdb::OPENVDB_MAGIC) return "another archive follows";
  return size == 1 ? "1 byte follows" : std::to_string(size) + " bytes follow";
}

}  // namespace vdbdither
