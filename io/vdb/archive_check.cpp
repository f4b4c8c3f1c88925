#include "io/vdb/archive_check.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>
#include <utility>

#include <openvdb/io/Archive.h>
#include <openvdb/io/DelayedLoadMetadata.h>
#include <openvdb/io/GridDescriptor.h>

#include "io/vdb/archive_digest.h"
#include "io/vdb/byte_cursor.h"
#include "io/vdb/tree_check.h"
#include "vdbdither/engine/estimate.h"
#include "vdbdither/engine/run_options.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

using openvdb::GridBase;
using openvdb::Metadata;

namespace {

constexpr std::uint32_t oldest_version = openvdb::OPENVDB_FILE_VERSION_NODE_MASK_COMPRESSION;

/// Bytes of the numbers of each map of OpenVDB.
constexpr std::array<std::pair<std::string_view, std::uint64_t>, 7> maps{
    {{"AffineMap", 16 * sizeof(double)},
     {"UnitaryMap", 16 * sizeof(double)},
     {"ScaleMap", 15 * sizeof(double)},
     {"UniformScaleMap", 15 * sizeof(double)},
     {"TranslationMap", 3 * sizeof(double)},
     {"ScaleTranslateMap", 18 * sizeof(double)},
     {"UniformScaleTranslateMap", 18 * sizeof(double)}}};
constexpr std::string_view frustum_map = "NonlinearFrustumMap";

/// Bytes of a type of metadata whose values all have the same size, else 0.
std::uint32_t fixedSize(const std::string& type) {
  if (!Metadata::isRegisteredType(type)) return 0;
  const Metadata::Ptr value = Metadata::createMetadata(type);
  return type == openvdb::StringMetadata::staticTypeName() ? 0 : value->size();
}

class ArchiveCheck {
 public:
  ArchiveCheck(std::istream& stream, std::uint64_t size, const std::string& where,
               const ArchiveLimits& limits, std::string& part)
      : stream_(stream), cursor_(stream, size), where_(where), limits_(limits), part_(part) {}

  void check() {
    try {
      checkAll();
    } catch (const DamagedBytes& damage) {
      throw unreadableArchive(where_, part_ + " is damaged at byte " +
                                          std::to_string(cursor_.position()) + ": " + damage.what +
                                          "; make it again in the tool that it comes from");
    }
  }

 private:
  void checkAll() {
    part_ = "its header";
    checkHeader();
    part_ = "its metadata";
    checkMetadata();
    const auto count = cursor_.take<std::uint32_t>();
    if (count > limits_.grids)
      throw tooLarge(std::to_string(count) + " grids", std::to_string(limits_.grids));
    for (std::uint32_t i = 0; i < count; ++i) checkGrid(i);
    refuseMore();
  }

  [[nodiscard]] DataError tooLarge(const std::string& what, const std::string& most) const {
    return DataError(where_ + ": " + part_ + " has " + what + "; at most " + most +
                     " are read; mend it in the tool that it comes from");
  }

  void checkHeader() {
    const std::string_view head(cursor_.take(archive_head_size), archive_head_size);
    std::int32_t magic = 0;
    std::memcpy(&magic, head.data(), sizeof magic);
    if (magic != openvdb::OPENVDB_MAGIC)
      throw unreadableArchive(where_, "it does not begin as one");
    std::uint32_t version = 0;
    std::memcpy(&version, head.data() + sizeof(std::int64_t), sizeof version);
    if (version < oldest_version || version > openvdb::OPENVDB_FILE_VERSION) {
      throw unreadableArchive(where_,
                              "its format is " + std::to_string(version) + ", and those from " +
                                  std::to_string(oldest_version) + " to " +
                                  std::to_string(openvdb::OPENVDB_FILE_VERSION) +
                                  " are read; save it again with another version of its tool");
    }
    states_ends_ = head[uuid_offset - 1] != 0;
  }

  /// A text that OpenVDB would read without a look at its length.
  std::string takeName(const std::string& what) {
    const auto bytes = cursor_.take<std::uint32_t>();
    if (bytes > limits_.name_bytes) {
      throw tooLarge(what + " of " + bytesText(bytes), bytesText(limits_.name_bytes));
    }
    return {cursor_.take(bytes), bytes};
  }

  void checkMetadata() {
    is_as_half_ = false;
    const auto count = cursor_.take<std::uint32_t>();
    if (count > limits_.metadata_entries) {
      throw tooLarge(std::to_string(count) + " entries of metadata",
                     std::to_string(limits_.metadata_entries));
    }
    std::uint64_t bytes = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::string key = takeName("a key of metadata");
      const std::string type = takeName("a type of metadata");
      const auto size = cursor_.take<std::uint32_t>();
      const bool is_of_leaves = type == openvdb::io::DelayedLoadMetadata::staticTypeName();
      // OpenVDB reads as many bytes as the type has, whatever the size says.
      if (const std::uint32_t fixed = is_of_leaves ? 0 : fixedSize(type);
          fixed > 0 && size != fixed)
        throw damagedMetadata(key);
      if (!is_of_leaves) bytes += size;
      if (bytes > limits_.metadata_bytes) {
        throw tooLarge(bytesText(static_cast<double>(bytes)) + " of metadata or more",
                       bytesText(static_cast<double>(limits_.metadata_bytes)));
      }
      cursor_.require(size);
      const bool is_flag = type == openvdb::BoolMetadata::staticTypeName();
      const bool is_on = is_flag && *cursor_.view(1) != 0;
      if (is_on && *cursor_.view(1) != 1) throw damagedMetadata(key);
      if (key == GridBase::META_SAVE_HALF_FLOAT) {
        if (!is_flag) throw damagedMetadata(key);
        is_as_half_ = is_on;
      }
      if (is_of_leaves && size > 0) {
        checkSizesOfLeaves(key, size);
      } else {
        cursor_.skip(size);
      }
    }
  }

  [[nodiscard]] DataError damagedMetadata(const std::string& key) const {
    return unreadableArchive(where_,
                             "the metadata '" + printable(key) + "' of " + part_ + " is damaged");
  }

  /// What OpenVDB keeps of each leaf so that a file can be read later in parts: two arrays of as
  /// many numbers as there are leaves, each packed by Blosc, or as it is where its size is 0.
  void checkSizesOfLeaves(const std::string& key, std::uint64_t size) {
    constexpr std::uint64_t mask_bytes = 1;
    constexpr std::uint64_t number_bytes = 8;
    constexpr std::uint32_t none = 0xFFFFFFFF;
    constexpr std::uint64_t header_bytes = 16;
    constexpr std::uint64_t padded_bytes = 128;  // OpenVDB pads what is less before it packs it
    const std::uint64_t end = cursor_.position() + size;
    const auto require = [&](bool condition) {
      if (!condition) throw damagedMetadata(key);
    };
    require(size >= 3 * sizeof(std::uint32_t));
    const auto leaves = cursor_.take<std::uint32_t>();
    require(leaves * (mask_bytes + number_bytes) <= std::max(limits_.metadata_bytes, end));
    const auto pass = [&](std::uint32_t packed, std::uint64_t unpacked) {
      const std::uint64_t bytes = packed > 0 ? packed : unpacked;
      require(cursor_.position() <= end && bytes <= end - cursor_.position());
      if (packed > 0) {
        require(packed >= header_bytes);
        std::array<std::uint32_t, 4> header{};
        std::memcpy(header.data(), cursor_.view(header_bytes), header_bytes);
        require(header[1] == std::max(unpacked, padded_bytes) && header[3] == packed);
      }
      cursor_.skip(bytes);
    };
    pass(cursor_.take<std::uint32_t>(), leaves * mask_bytes);
    require(cursor_.position() + sizeof(std::uint32_t) <= end);
    const auto packed = cursor_.take<std::uint32_t>();
    if (packed != none) pass(packed, leaves * number_bytes);
    cursor_.skip(end - cursor_.position());
  }

  void checkGrid(std::uint32_t index) {
    part_ = "grid " + std::to_string(index + 1);
    const std::string name = openvdb::io::GridDescriptor::stripSuffix(takeName("a name"));
    part_ = "grid '" + printable(name) + "'";
    std::string type = takeName("a type");
    constexpr std::string_view half = "_HalfFloat";
    if (type.ends_with(half)) type.resize(type.size() - half.size());
    if (!GridBase::isRegistered(type)) {
      throw unreadableArchive(where_,
                              part_ + " is of type '" + printable(type) +
                                  "', which OpenVDB does not know without a plug-in; leave it out");
    }
    const bool is_instance = !takeName("the name of another grid").empty();
    cursor_.skip(2 * sizeof(std::int64_t));
    const auto end = cursor_.take<std::int64_t>();
    const auto compression = cursor_.take<std::uint32_t>();
    checkMetadata();
    checkMap();
    if (is_instance) return;
    if (const auto layout = treeLayoutOf(type)) {
      memory_ += passTree(cursor_, stream_, *layout, {compression, is_as_half_});
      refuseTooMuch();
    } else {
      passForeignTree(type, end);
    }
  }

  void checkMap() {
    const std::string map = takeName("a transform with a name");
    if (map == frustum_map) {
      cursor_.skip(8 * sizeof(double));
      passNumbers(takeName("a transform with a name"));
    } else {
      passNumbers(map);
    }
  }

  void passNumbers(const std::string& map) {
    const auto* found = std::find_if(maps.begin(), maps.end(),
                                     [&](const auto& known) { return known.first == map; });
    if (found == maps.end()) {
      throw unreadableArchive(where_, part_ + " has the transform '" + printable(map) +
                                          "', which OpenVDB " + OPENVDB_LIBRARY_VERSION_STRING +
                                          " does not know; save it with another");
    }
    cursor_.skip(found->second);
  }

  /// Only the archive knows where the voxels of another type end.
  void passForeignTree(const std::string& type, std::int64_t end) {
    const auto begin = static_cast<std::int64_t>(cursor_.position());
    if (!states_ends_) {
      throw unreadableArchive(where_, part_ + " is of type '" + printable(type) +
                                          "', of which no operator takes the voxels; leave it out");
    }
    if (end < begin) throw DamagedBytes{"it ends before it begins"};
    cursor_.skip(static_cast<std::uint64_t>(end - begin));
  }

  void refuseTooMuch() const {
    // Not worth a look at the system.
    constexpr std::uint64_t little = 64ULL << 20U;
    if (memory_ <= little) return;
    const double free = limits_.memory_bytes.value_or(freeMemoryBytes());
    if (static_cast<double>(memory_) <= free) return;
    throw DataError(where_ + " takes " + bytesText(static_cast<double>(memory_)) +
                    " of memory up to " + part_ + ", and " + bytesText(free) +
                    " may be used; leave grids out, or read it where there is more memory");
  }

  void refuseMore() {
    const std::uint64_t more = cursor_.left();
    if (more == 0) return;
    const auto begin = std::min<std::uint64_t>(more, sizeof(std::int64_t));
    throw DataError(
        where_ + " goes on behind its archive: " + whatFollows({cursor_.view(begin), begin}, more) +
        "; give one archive at a time");
  }

  std::istream& stream_;
  ByteCursor cursor_;
  const std::string& where_;
  ArchiveLimits limits_;
  std::string& part_;
  bool states_ends_ = false;  ///< where each grid ends
  bool is_as_half_ = false;   ///< what the metadata say that were passed last
  std::uint64_t memory_ = 0;
};

}  // namespace

void checkArchive(std::istream& stream, std::uint64_t size, const std::string& where,
                  const ArchiveLimits& limits, std::string& part) {
  const auto begin = stream.tellg();
  ArchiveCheck(stream, size, where, limits, part).check();
  stream.seekg(begin);
}

bool hasReadVoxels(const std::string& type) { return treeLayoutOf(type).has_value(); }

DataError unreadableArchive(const std::string& where, const std::string& why) {
  return DataError(where + " is not a readable VDB archive: " + why);
}

}  // namespace vdbdither
