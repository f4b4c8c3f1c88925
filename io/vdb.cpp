#include "io/vdb.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <span>
#include <sstream>

#include <openvdb/io/Stream.h>

#include "io/archive_digest.h"
#include "vdbdither/errors.h"
#include "vdbdither/openvdb.h"
#include "vdbdither/options.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::GridBase;
using openvdb::Vec3d;

namespace {

constexpr const char* box_key = "vdbdither:box";

std::uint32_t compressionFlags(VdbCodec codec) {
  switch (codec) {
    case VdbCodec::none:
      return openvdb::io::COMPRESS_NONE;
    case VdbCodec::mask:
      return openvdb::io::COMPRESS_ACTIVE_MASK;
    case VdbCodec::blosc:
      return openvdb::io::COMPRESS_ACTIVE_MASK | openvdb::io::COMPRESS_BLOSC;
  }
  return openvdb::io::COMPRESS_NONE;
}

/// OpenVDB's own File ignores failed writes, so the archive goes to a stream of ours.
class StreamArchive : public openvdb::io::Archive {
 public:
  StreamArchive(const VdbContents& contents, VdbCodec codec) {
    setCompression(compressionFlags(codec));
    for (const auto& [name, grid] : contents.grids) {
      // Names live in the metadata of a grid, and grids are shared: a shallow copy takes the name.
      openvdb::MetaMap metadata(*grid);
      metadata.insertMeta(GridBase::META_GRID_NAME, openvdb::StringMetadata(name));
      grids_.push_back(grid->copyGridReplacingMetadata(metadata));
    }
    for (const auto& [key, text] : contents.metadata)
      metadata_.insertMeta(key, openvdb::StringMetadata(text));
  }

  void writeTo(std::ostream& stream, bool seekable) const {
    write(stream, grids_, seekable, metadata_);
  }

 private:
  openvdb::GridCPtrVec grids_;
  openvdb::MetaMap metadata_;
};

/// Reads `stream` to its end. Returns the UUID that the archive should have, and the one that is
/// there.
std::pair<std::string, std::string> digestAndUuid(std::istream& stream) {
  Digest digest;
  std::uint64_t total = 0;
  std::string uuid;
  std::vector<char> buffer(1 << 20);
  while (stream.read(buffer.data(), static_cast<std::streamsize>(buffer.size())),
         stream.gcount() > 0) {
    const auto size = static_cast<std::size_t>(stream.gcount());
    if (uuid.empty() && size >= uuid_offset + uuid_size) {
      uuid.assign(buffer.data() + uuid_offset, uuid_size);
      neutral_uuid.copy(buffer.data() + uuid_offset, uuid_size);
    }
    digest.update(buffer.data(), size);
    total += size;
  }
  return {uuidOf(digest.finish(), total), uuid};
}

std::string quoted(const std::filesystem::path& path) { return "'" + path.string() + "'"; }

/// Statistics that OpenVDB writes into a grid's metadata are of the file, not of the grid.
void dropFileStatistics(GridBase& grid) {
  std::vector<std::string> keys;
  for (auto entry = grid.beginMeta(); entry != grid.endMeta(); ++entry) {
    if (entry->first.starts_with("file_")) keys.push_back(entry->first);
  }
  for (const std::string& key : keys) grid.removeMeta(key);
}

VdbContents collected(const openvdb::GridPtrVec& grids, const openvdb::MetaMap& metadata) {
  VdbContents contents;
  for (const GridBase::Ptr& grid : grids) {
    std::string name = grid->getName();
    for (int copy = 2; contents.grids.contains(name); ++copy)
      name = grid->getName() + "_" + std::to_string(copy);
    contents.grids[name] = grid;
  }
  for (auto entry = metadata.beginMeta(); entry != metadata.endMeta(); ++entry) {
    contents.metadata[entry->first] = entry->second->str();
  }
  return contents;
}

std::string boxText(const CoordBBox& box) {
  std::string text;
  for (const Coord& corner : {box.min(), box.max()}) {
    for (int axis = 0; axis < 3; ++axis)
      text += (text.empty() ? "" : " ") + std::to_string(corner[axis]);
  }
  return text;
}

CoordBBox parseBox(const std::string& text, const std::string& where) {
  std::istringstream stream(text);
  CoordBBox box;
  for (Coord* corner : {&box.min(), &box.max()}) {
    for (int axis = 0; axis < 3; ++axis) stream >> (*corner)[axis];
  }
  if (!stream) throw DataError(where + ": the metadata " + box_key + " is not six whole numbers");
  return box;
}

/// Pitch and origin of a grid whose transform only scales and shifts.
Lattice latticeOf(const GridBase& grid, const std::string& where) {
  const auto& map = *grid.transform().baseMap();
  const openvdb::Mat4d matrix = map.getAffineMap()->getMat4();
  Lattice lattice;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      if ((row == column) ? !(matrix(row, column) > 0) : matrix(row, column) != 0) {
        throw DataError(where + ": grid '" + grid.getName() +
                        "' is turned or sheared; bring it onto the printer's lattice first");
      }
    }
    lattice.pitch_mm[row] = matrix(row, row);
    lattice.origin_mm[row] = matrix(3, row);
  }
  return lattice;
}

}  // namespace

std::string uuidOf(const Digest::Value& value, std::uint64_t size) {
  std::array<char, 13> digits{};
  std::snprintf(digits.data(), digits.size(), "%012llx", static_cast<unsigned long long>(size));
  std::string hex = hexText(value).substr(0, 20) + digits.data();
  hex[12] = '8';
  hex[16] = 'a';
  return hex.substr(0, 8) + "-" + hex.substr(8, 4) + "-" + hex.substr(12, 4) + "-" +
         hex.substr(16, 4) + "-" + hex.substr(20);
}

bool isDigestUuid(std::string_view uuid) {
  return uuid.size() == uuid_size && uuid[14] == '8' && uuid[19] == 'a';
}

std::uint64_t sizeIn(std::string_view digest_uuid) {
  return std::strtoull(std::string(digest_uuid.substr(24)).c_str(), nullptr, 16);
}

std::string uuidOf(std::string_view archive) {
  Digest digest;
  digest.update(archive.data(), uuid_offset);
  digest.update(neutral_uuid.data(), uuid_size);
  digest.update(archive.data() + uuid_offset + uuid_size, archive.size() - uuid_offset - uuid_size);
  return uuidOf(digest.finish(), archive.size());
}

VdbContents readArchive(std::istream& stream) {
  // A read that comes up short must throw: OpenVDB would go on with whatever is in memory.
  stream.exceptions(std::ios::badbit | std::ios::failbit);
  try {
    openvdb::io::Stream archive(stream, false);
    const openvdb::GridPtrVecPtr grids = archive.getGrids();
    for (const GridBase::Ptr& grid : *grids) dropFileStatistics(*grid);
    return collected(*grids, *archive.getMetadata());
  } catch (const openvdb::Exception& error) {
    throw DataError(error.what());
  } catch (const std::ios::failure&) {
    throw DataError("it ends too early");
  }
}

void initializeVdb() { openvdb::initialize(); }

std::string archiveBytes(const VdbContents& contents, VdbCodec codec) {
  std::ostringstream stream(std::ios::binary);
  StreamArchive(contents, codec).writeTo(stream, false);
  std::string bytes = std::move(stream).str();
  uuidOf(bytes).copy(bytes.data() + uuid_offset, uuid_size);
  return bytes;
}

void writeVdb(const std::filesystem::path& path, const VdbContents& contents, VdbCodec codec,
              const std::filesystem::path& shown) {
  const auto failed = [&] {
    return DataError("cannot write " + quoted(shown) + ": " + std::strerror(errno ? errno : EIO));
  };
  errno = 0;
  try {
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out | std::ios::trunc);
    if (!file) throw failed();
    file.exceptions(std::ios::badbit | std::ios::failbit);
    StreamArchive(contents, codec).writeTo(file, true);
    file.flush();
    file.exceptions(std::ios::badbit);
    file.seekg(0);
    const std::string uuid = digestAndUuid(file).first;
    file.clear();
    file.exceptions(std::ios::badbit | std::ios::failbit);
    file.seekp(uuid_offset);
    file.write(uuid.data(), uuid_size);
    file.close();
  } catch (const std::ios::failure&) {
    throw failed();
  }
}

VdbContents readVdb(const std::filesystem::path& path) {
  std::error_code none;
  if (!std::filesystem::exists(path, none)) throw DataError("no such file " + quoted(path));
  if (!std::filesystem::is_regular_file(path, none))
    throw DataError(quoted(path) + " is not a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw DataError("cannot read " + quoted(path) + ": " + std::strerror(errno));
  const auto [expected, uuid] = digestAndUuid(file);
  if (isDigestUuid(uuid) && uuid != expected) {
    throw DataError(quoted(path) + " is damaged: its checksum does not match; make it again");
  }
  file.clear();
  file.seekg(0);
  try {
    return readArchive(file);
  } catch (const DataError& error) {
    throw DataError(quoted(path) + " is not a readable VDB file: " + error.what());
  }
}

GridConstPtr readGrid(const std::filesystem::path& path, const std::string& name) {
  const VdbContents contents = readVdb(path);
  if (const auto found = contents.grids.find(name); found != contents.grids.end())
    return found->second;
  if (contents.grids.size() == 1) return contents.grids.begin()->second;
  std::string message = quoted(path) + " has no grid '" + name + "'; it has";
  for (const auto& [known, grid] : contents.grids) message += " " + known;
  throw DataError(message);
}

Schema schemaOf(const VdbContents& contents, const std::string& where) {
  if (contents.grids.empty()) throw DataError(where + " holds no grid");
  Schema schema;
  schema.metadata = contents.metadata;
  const GridBase& first = *contents.grids.begin()->second;
  schema.lattice = latticeOf(first, where);
  for (const auto& [name, grid] : contents.grids) {
    const Lattice lattice = latticeOf(*grid, where);
    if (lattice.pitch_mm != schema.lattice.pitch_mm ||
        lattice.origin_mm != schema.lattice.origin_mm) {
      throw DataError(where + ": grids '" + first.getName() + "' and '" + name +
                      "' lie on different lattices");
    }
    const GridBase::Ptr empty = grid->copyGridWithNewTree();
    dropFileStatistics(*empty);
    schema.grids[name] = empty;
  }
  if (const auto found = schema.metadata.find(box_key); found != schema.metadata.end()) {
    schema.lattice.box = parseBox(found->second, where);
    schema.metadata.erase(found);
  } else {
    for (const auto& [name, grid] : contents.grids) {
      const auto min = grid->getMetadata<openvdb::Vec3IMetadata>(GridBase::META_FILE_BBOX_MIN);
      const auto max = grid->getMetadata<openvdb::Vec3IMetadata>(GridBase::META_FILE_BBOX_MAX);
      if (min && max) {
        schema.lattice.box.expand(CoordBBox(Coord(min->value()), Coord(max->value())));
      } else {
        schema.lattice.box.expand(grid->evalActiveVoxelBoundingBox());
      }
    }
  }
  schema.metadata.erase("creator");
  return schema;
}

VdbContents contentsOf(const Schema& schema, Grids grids) {
  VdbContents contents{std::move(grids), schema.metadata};
  contents.metadata[box_key] = boxText(schema.lattice.box);
  contents.metadata["creator"] = "vdbdither";
  return contents;
}

}  // namespace vdbdither
