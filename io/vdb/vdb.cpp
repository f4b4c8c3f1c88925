#include "io/vdb/vdb.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>
#include <unistd.h>
#include <vector>

#include <openvdb/io/Stream.h>
#include <openvdb/tools/ChangeBackground.h>

#include "io/vdb/archive_digest.h"
#include "vdbdither/engine/options.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::GridBase;
using openvdb::Vec3d;

namespace {

constexpr const char* box_key = "vdbdither:box";
/// Of a grid of half floats: its background before it was rounded.
constexpr const char* background_key = "vdbdither:background";

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
  StreamArchive(const VdbContents& contents, VdbCodec codec, bool as_half) {
    setCompression(compressionFlags(codec));
    for (const auto& [name, grid] : contents.grids) {
      // Names live in the metadata of a grid, and grids are shared: a shallow copy takes the name.
      openvdb::MetaMap metadata(*grid);
      metadata.insertMeta(GridBase::META_GRID_NAME, openvdb::StringMetadata(name));
      if (as_half) addHalf(*grid, metadata);
      grids_.push_back(grid->copyGridReplacingMetadata(metadata));
    }
    for (const auto& [key, text] : contents.metadata)
      metadata_.insertMeta(key, openvdb::StringMetadata(text));
  }

  void writeTo(std::ostream& stream, bool seekable) const {
    write(stream, grids_, seekable, metadata_);
  }

 private:
  static void addHalf(const GridBase& grid, openvdb::MetaMap& metadata) {
    const std::string type = grid.valueType();
    if (type != "float" && type != "double" && !type.starts_with("vec3")) return;
    metadata.insertMeta(GridBase::META_SAVE_HALF_FLOAT, openvdb::BoolMetadata(true));
    if (const auto* numbers = dynamic_cast<const openvdb::FloatGrid*>(&grid))
      metadata.insertMeta(background_key, openvdb::FloatMetadata(numbers->background()));
  }

  openvdb::GridCPtrVec grids_;
  openvdb::MetaMap metadata_;
};

std::string quoted(const std::filesystem::path& path) { return "'" + path.string() + "'"; }

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
  const auto background = grid.getMetadata<openvdb::FloatMetadata>(background_key);
  auto* numbers = dynamic_cast<openvdb::FloatGrid*>(&grid);
  if (background && numbers) openvdb::tools::changeBackground(numbers->tree(), background->value());
  grid.removeMeta(background_key);
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

/// Bytes that are there already, as a stream.
class MemoryBuffer : public std::streambuf {
 public:
  explicit MemoryBuffer(std::string_view bytes) {
    char* begin = const_cast<char*>(bytes.data());
    setg(begin, begin, begin + bytes.size());
  }
};

/// OpenVDB's Stream, not its File: without delayed loading it meets every truncation with an
/// exception.
VdbContents readStream(std::istream& stream, const std::string& where) {
  // A read that comes up short must throw: OpenVDB would go on with whatever is in memory.
  stream.exceptions(std::ios::badbit | std::ios::failbit);
  try {
    openvdb::io::Stream archive(stream, false);
    const openvdb::GridPtrVecPtr grids = archive.getGrids();
    for (const GridBase::Ptr& grid : *grids) {
      dropFileStatistics(*grid);
      dropHalf(*grid);
    }
    return collected(*grids, *archive.getMetadata());
  } catch (const openvdb::Exception& error) {
    throw DataError(where + " is not a readable VDB archive: " + error.what());
  } catch (const std::ios::failure&) {
    throw DataError(where + " is not a readable VDB archive: it ends too early");
  }
}

std::ifstream openArchive(const std::filesystem::path& path) {
  std::error_code none;
  if (!std::filesystem::exists(path, none)) throw DataError("no such file " + quoted(path));
  if (!std::filesystem::is_regular_file(path, none))
    throw DataError(quoted(path) + " is not a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw DataError("cannot read " + quoted(path) + ": " + std::strerror(errno));
  std::string head(archive_head_size, 0);
  if (!file.read(head.data(), static_cast<std::streamsize>(head.size()))) {
    throw DataError(quoted(path) + " is not a readable VDB archive: it is too short");
  }
  std::int32_t magic = 0;
  std::memcpy(&magic, head.data(), sizeof magic);
  if (magic != openvdb::OPENVDB_MAGIC) {
    throw DataError(quoted(path) +
                    " is not a readable VDB archive: it is a file of another kind; meshes come in "
                    "by mesh2sdf, stacks of slices by slice-import");
  }
  file.clear();
  file.seekg(0);
  if (const auto length = statedLength(head);
      length && *length != std::filesystem::file_size(path, none)) {
    throw DataError(quoted(path) + " is cut short: it was written with " + std::to_string(*length) +
                    " bytes");
  }
  return file;
}

/// The UUID that the archive in `file` should have and the one it has.
std::pair<std::string, std::string> uuidsOf(std::istream& file) {
  ArchiveDigest digest;
  std::string head;
  std::vector<char> buffer(1 << 20);
  while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size())), file.gcount() > 0) {
    if (head.empty())
      head.assign(buffer.data(), std::min<std::size_t>(file.gcount(), archive_head_size));
    digest.update(buffer.data(), static_cast<std::size_t>(file.gcount()));
  }
  file.clear();
  file.seekg(0);
  return {digest.uuid(), statedLength(head) ? head.substr(uuid_offset) : ""};
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

/// Pitch and origin of a grid whose transform must only scale and shift.
Lattice plainLatticeOf(const GridBase& grid, const std::string& where) {
  if (const auto lattice = latticeOf(grid)) return *lattice;
  const std::string refused = where + ": grid '" + grid.getName() + "' ";
  if (!grid.transform().isLinear())
    throw DataError(refused + "lies in a frustum; resample it in the tool that it comes from");
  throw DataError(refused + "is turned or sheared; resample --grid " + grid.getName() +
                  " brings numbers onto the printer's lattice");
}

}  // namespace

std::optional<Lattice> latticeOf(const GridBase& grid) {
  if (!grid.transform().isLinear()) return std::nullopt;
  const openvdb::Mat4d matrix = grid.transform().baseMap()->getAffineMap()->getMat4();
  Lattice lattice;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      if ((row == column) ? !(matrix(row, column) > 0) : matrix(row, column) != 0)
        return std::nullopt;
    }
    lattice.pitch_mm[row] = matrix(row, row);
    lattice.origin_mm[row] = matrix(3, row);
  }
  return lattice;
}

void ArchiveDigest::update(const char* bytes, std::size_t size) {
  const std::size_t uuid_begin = std::clamp(uuid_offset, size_, size_ + size) - size_;
  const std::size_t uuid_end = std::clamp(archive_head_size, size_, size_ + size) - size_;
  digest_.update(bytes, uuid_begin);
  digest_.update(bytes + uuid_end, size - uuid_end);
  size_ += size;
}

std::string ArchiveDigest::uuid() {
  const std::string digest = hexText(digest_.finish());
  std::array<char, 17> length{};
  std::snprintf(length.data(), length.size(), "%012zx", size_);
  const std::string size = length.data();
  return size.substr(0, 8) + "-" + size.substr(8, 4) + "-8" + digest.substr(0, 3) + "-a" +
         digest.substr(3, 3) + "-" + digest.substr(6, 12);
}

std::optional<std::size_t> statedLength(std::string_view head) {
  if (head.size() < archive_head_size) return std::nullopt;
  const std::string_view uuid = head.substr(uuid_offset, uuid_size);
  if (uuid[14] != '8' || uuid[19] != 'a') return std::nullopt;
  const std::string digits = std::string(uuid.substr(0, 8)) + std::string(uuid.substr(9, 4));
  std::size_t length = 0;
  const auto [end, error] =
      std::from_chars(digits.data(), digits.data() + digits.size(), length, 16);
  if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return length;
}

VdbContents contentsOfBytes(std::string_view bytes, const std::string& where) {
  if (const auto length = statedLength(bytes)) {
    ArchiveDigest digest;
    digest.update(bytes.data(), bytes.size());
    if (*length != bytes.size() || digest.uuid() != bytes.substr(uuid_offset, uuid_size)) {
      throw DataError(where + " is damaged: its checksum does not match");
    }
  }
  if (bytes.size() < archive_head_size)
    throw DataError(where + " is not a readable VDB archive: it is too short");
  MemoryBuffer buffer(bytes);
  std::istream stream(&buffer);
  return readStream(stream, where);
}

void initializeVdb() { openvdb::initialize(); }

std::string archiveBytes(const VdbContents& contents, VdbCodec codec) {
  std::ostringstream stream(std::ios::binary);
  StreamArchive(contents, codec, false).writeTo(stream, false);
  std::string bytes = std::move(stream).str();
  ArchiveDigest digest;
  digest.update(bytes.data(), bytes.size());
  digest.uuid().copy(bytes.data() + uuid_offset, uuid_size);
  return bytes;
}

void writeVdb(const std::filesystem::path& path, const VdbContents& contents, VdbCodec codec,
              const std::filesystem::path& shown, bool as_half) {
  const auto failed = [&] {
    return DataError("cannot write " + quoted(shown) + ": " + std::strerror(errno ? errno : EIO));
  };
  errno = 0;
  try {
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out | std::ios::trunc);
    if (!file) throw failed();
    file.exceptions(std::ios::badbit | std::ios::failbit);
    StreamArchive(contents, codec, as_half).writeTo(file, true);
    file.flush();
    file.exceptions(std::ios::badbit);
    file.seekg(0);
    const std::string uuid = uuidsOf(file).first;
    file.exceptions(std::ios::badbit | std::ios::failbit);
    file.seekp(uuid_offset);
    file.write(uuid.data(), uuid_size);
    file.close();
  } catch (const std::ios::failure&) {
    throw failed();
  }
}

VdbContents readVdb(const std::filesystem::path& path) {
  std::ifstream file = openArchive(path);
  // Before OpenVDB sees it, which takes damaged bytes as they are.
  const auto [computed, stated] = uuidsOf(file);
  if (!stated.empty() && stated != computed) {
    throw DataError(quoted(path) + " is damaged: its checksum does not match; make it again");
  }
  return readStream(file, quoted(path));
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
  schema.lattice = plainLatticeOf(first, where);
  for (const auto& [name, grid] : contents.grids) {
    const Lattice lattice = plainLatticeOf(*grid, where);
    if (lattice.pitch_mm != schema.lattice.pitch_mm ||
        lattice.origin_mm != schema.lattice.origin_mm) {
      throw DataError(where + ": grids '" + first.getName() + "' and '" + name +
                      "' lie on different lattices; take some with read --grids NAME, and info "
                      "says what each is good for");
    }
    schema.grids[name] = grid->copyGridWithNewTree();
  }
  if (const auto found = schema.metadata.find(box_key); found != schema.metadata.end()) {
    schema.lattice.box = parseBox(found->second, where);
    schema.metadata.erase(found);
  } else {
    for (const auto& [name, grid] : contents.grids)
      schema.lattice.box.expand(grid->evalActiveVoxelBoundingBox());
  }
  schema.metadata.erase(creator_key);
  return schema;
}

VdbContents contentsOf(const Schema& schema, Grids grids) {
  VdbContents contents{std::move(grids), schema.metadata};
  contents.metadata[box_key] = boxText(schema.lattice.box);
  contents.metadata[creator_key] = "vdbdither";
  return contents;
}

}  // namespace vdbdither
