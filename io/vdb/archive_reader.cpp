#include "io/vdb/archive_reader.h"

#include <cstring>
#include <ios>
#include <vector>

#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/io.h>
#include <openvdb/tools/ChangeBackground.h>

#include "io/vdb/archive_digest.h"
#include "vdbdither/engine/run_options.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

using openvdb::GridBase;
using openvdb::Metadata;
using openvdb::MetaMap;

namespace {

constexpr const char* without_volume =
    " has a transform without volume, or of numbers that are not finite";
constexpr std::uint32_t oldest_version = openvdb::OPENVDB_FILE_VERSION_NODE_MASK_COMPRESSION;

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

/// Reads an archive part by part. Before OpenVDB reads a part, its counts and sizes are checked
/// here.
class ArchiveReader : private openvdb::io::Archive {
 public:
  ArchiveReader(std::istream& stream, std::uint64_t size, const std::string& where,
                const ArchiveLimits& limits)
      : stream_(stream), size_(size), where_(where), limits_(limits) {}

  VdbContents read() {
    // A read that comes up short must throw: OpenVDB would go on with whatever is in memory.
    stream_.exceptions(std::ios::badbit | std::ios::failbit);
    part_ = "its header";
    try {
      readAll();
      for (const GridBase::Ptr& grid : grids_) checkTransform(*grid);
    } catch (const std::ios::failure&) {
      throw unreadable("it ends too early");
    } catch (const openvdb::ArithmeticError&) {
      throw unreadable(part_ + without_volume);
    } catch (const openvdb::Exception&) {
      throw unreadable(part_ + " is damaged, or uses what OpenVDB " +
                       OPENVDB_LIBRARY_VERSION_STRING + " does not know");
    } catch (const std::length_error&) {
      throw unreadable(part_ + " is damaged");
    }
    return collected();
  }

 private:
  [[nodiscard]] DataError unreadable(const std::string& why) const {
    return DataError(where_ + " is not a readable VDB archive: " + why);
  }

  [[nodiscard]] DataError tooLarge(const std::string& what, const std::string& most) const {
    return DataError(where_ + ": " + part_ + " has " + what + "; at most " + most +
                     " are read; mend it in the tool that it comes from");
  }

  template <typename T>
  T take() {
    T value{};
    stream_.read(reinterpret_cast<char*>(&value), sizeof value);
    return value;
  }

  [[nodiscard]] std::uint64_t position() { return static_cast<std::uint64_t>(stream_.tellg()); }

  /// Passes over `bytes` of the stream, which must be there.
  void skip(std::uint64_t bytes) {
    const std::uint64_t at = position();
    if (bytes > size_ - at) throw unreadable("it ends too early");
    stream_.seekg(static_cast<std::streamoff>(at + bytes));
  }

  /// A text that OpenVDB would read without a look at its length.
  std::string takeName(const std::string& what) {
    const auto bytes = take<std::uint32_t>();
    if (bytes > limits_.name_bytes) {
      throw tooLarge(what + " of " + bytesText(bytes), bytesText(limits_.name_bytes));
    }
    std::string name(bytes, '\0');
    stream_.read(name.data(), bytes);
    return name;
  }

  /// Passes over a map of metadata and checks it.
  void checkMetadata() {
    const auto count = take<std::uint32_t>();
    if (count > limits_.metadata_entries) {
      throw tooLarge(std::to_string(count) + " entries of metadata",
                     std::to_string(limits_.metadata_entries));
    }
    std::uint64_t bytes = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::string key = takeName("a key of metadata");
      const std::string type = takeName("a type of metadata");
      const auto size = take<std::uint32_t>();
      // OpenVDB reads as many bytes as the type has, whatever the size says.
      if (const std::uint32_t fixed = fixedSize(type); fixed > 0 && size != fixed)
        throw unreadable("the metadata '" + key + "' of " + part_ + " is damaged");
      if (key != GridBase::META_FILE_DELAYED_LOAD) bytes += size;
      if (bytes > limits_.metadata_bytes) {
        throw tooLarge(bytesText(static_cast<double>(bytes)) + " of metadata or more",
                       bytesText(static_cast<double>(limits_.metadata_bytes)));
      }
      skip(size);
    }
  }

  /// Bytes of a type of metadata whose values all have the same size, else 0.
  static std::uint32_t fixedSize(const std::string& type) {
    if (!Metadata::isRegisteredType(type)) return 0;
    const Metadata::Ptr value = Metadata::createMetadata(type);
    return type == openvdb::StringMetadata::staticTypeName() ? 0 : value->size();
  }

  void checkVersion() {
    std::string head(archive_head_size, '\0');
    stream_.read(head.data(), static_cast<std::streamsize>(head.size()));
    stream_.seekg(0);
    std::int32_t magic = 0;
    std::memcpy(&magic, head.data(), sizeof magic);
    if (magic != openvdb::OPENVDB_MAGIC) throw unreadable("it does not begin as one");
    std::uint32_t version = 0;
    std::memcpy(&version, head.data() + sizeof(std::int64_t), sizeof version);
    if (version < oldest_version || version > openvdb::OPENVDB_FILE_VERSION) {
      throw unreadable("its format is " + std::to_string(version) + ", and those from " +
                       std::to_string(oldest_version) + " to " +
                       std::to_string(openvdb::OPENVDB_FILE_VERSION) +
                       " are read; save it again with another version of its tool");
    }
  }

  void readAll() {
    checkVersion();
    readHeader(stream_);
    auto tags = std::make_shared<openvdb::io::StreamMetadata>();
    openvdb::io::setStreamMetadataPtr(stream_, tags, false);
    openvdb::io::setVersion(stream_, libraryVersion(), fileVersion());
    openvdb::io::setDataCompression(stream_, compression());
    part_ = "its metadata";
    checkThenReturn([&] { checkMetadata(); });
    metadata_.readMeta(stream_);
    const auto count = take<std::uint32_t>();
    if (count > limits_.grids)
      throw tooLarge(std::to_string(count) + " grids", std::to_string(limits_.grids));
    NamedGridMap by_name;
    std::vector<openvdb::io::GridDescriptor> descriptors;
    for (std::uint32_t i = 0; i < count; ++i) readOne(i, by_name, descriptors);
    part_ = "a grid that shares its voxels with another";
    for (const auto& descriptor : descriptors) connectInstance(descriptor, by_name);
    refuseMore();
  }

  /// Calls `check` and returns to where the stream was.
  template <typename Function>
  void checkThenReturn(const Function& check) {
    const auto begin = stream_.tellg();
    check();
    stream_.seekg(begin);
  }

  void readOne(std::uint32_t index, NamedGridMap& by_name,
               std::vector<openvdb::io::GridDescriptor>& descriptors) {
    part_ = "grid " + std::to_string(index + 1);
    checkThenReturn([&] {
      const std::string name = openvdb::io::GridDescriptor::stripSuffix(takeName("a name"));
      part_ = "grid '" + name + "'";
      std::string type = takeName("a type");
      constexpr std::string_view half = "_HalfFloat";
      if (type.ends_with(half)) type.resize(type.size() - half.size());
      if (!GridBase::isRegistered(type)) {
        throw unreadable(part_ + " is of type '" + type +
                         "', which OpenVDB does not know without a plug-in; leave it out");
      }
      takeName("the name of another grid");
      skip(3 * sizeof(std::int64_t));
      skip(sizeof(std::uint32_t));
      checkMetadata();
    });
    openvdb::io::GridDescriptor descriptor;
    const GridBase::Ptr grid = descriptor.read(stream_);
    readGrid(grid, descriptor, stream_);
    by_name[descriptor.uniqueName()] = grid;
    descriptors.push_back(descriptor);
    grids_.push_back(grid);
  }

  void checkTransform(const GridBase& grid) {
    part_ = "grid '" + grid.getName() + "'";
    if (!grid.transform().isLinear()) return;
    const openvdb::Mat4d matrix = grid.transform().baseMap()->getAffineMap()->getMat4();
    if (!matrix.isFinite()) throw unreadable(part_ + without_volume);
  }

  void refuseMore() {
    const std::uint64_t more = size_ - position();
    if (more == 0) return;
    std::string begin(std::min<std::uint64_t>(more, sizeof(std::int64_t)), '\0');
    stream_.read(begin.data(), static_cast<std::streamsize>(begin.size()));
    throw DataError(where_ + " goes on behind its archive: " + whatFollows(begin, more) +
                    "; give one archive at a time");
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
