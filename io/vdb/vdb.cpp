#include "io/vdb/vdb.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>
#include <unistd.h>
#include <vector>

#include <openvdb/io/Archive.h>

#include "io/file/files_read.h"
#include "io/vdb/archive_digest.h"
#include "io/vdb/archive_reader.h"
#include "io/vdb/grid_checks.h"
#include "vdbdither/engine/options.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/printable.h"

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
      metadata.insertMeta(half_background_key, openvdb::FloatMetadata(numbers->background()));
  }

  openvdb::GridCPtrVec grids_;
  openvdb::MetaMap metadata_;
};

std::string quoted(const std::filesystem::path& path) { return "'" + path.string() + "'"; }

/// Bytes that are there already, as a stream that can seek.
class MemoryBuffer : public std::streambuf {
 public:
  explicit MemoryBuffer(std::string_view bytes) {
    char* begin = const_cast<char*>(bytes.data());
    setg(begin, begin, begin + bytes.size());
  }

 protected:
  pos_type seekoff(off_type offset, std::ios::seekdir from, std::ios::openmode) override {
    const off_type size = egptr() - eback();
    const off_type base = from == std::ios::beg   ? 0
                          : from == std::ios::cur ? gptr() - eback()
                                                  : size;
    const off_type at = base + offset;
    if (at < 0 || at > size) return pos_type(off_type(-1));
    setg(eback(), eback() + at, egptr());
    return pos_type(at);
  }
  pos_type seekpos(pos_type position, std::ios::openmode mode) override {
    return seekoff(position, std::ios::beg, mode);
  }
};

std::uint64_t sizeOf(const std::filesystem::path& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) throw DataError("cannot read " + quoted(path) + ": " + error.message());
  return size;
}

/// Refuses a file that has not the length that its archive states.
void checkLength(std::istream& file, std::uint64_t length, const std::filesystem::path& path) {
  const std::uint64_t size = sizeOf(path);
  if (size == length) return;
  if (size < length) {
    throw DataError(quoted(path) + " is cut short: it was written with " + std::to_string(length) +
                    " bytes");
  }
  file.seekg(static_cast<std::streamoff>(length));
  std::string begin(std::min<std::uint64_t>(size - length, sizeof(std::int64_t)), '\0');
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  throw DataError(quoted(path) +
                  " goes on behind its archive: " + whatFollows(begin, size - length) +
                  "; what was meant for a pipe is read from standard input");
}

std::ifstream openArchive(const std::filesystem::path& path) {
  std::error_code none;
  if (!std::filesystem::exists(path, none)) throw DataError("no such file " + quoted(path));
  if (!std::filesystem::is_regular_file(path, none))
    throw DataError(quoted(path) + " is not a file");
  noteFileRead(path);
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
  if (const auto length = statedLength(head)) checkLength(file, *length, path);
  return file;
}

/// The UUID that the archive in `file` should have.
std::string uuidOf(std::istream& file) {
  ArchiveDigest digest;
  std::vector<char> buffer(1 << 20);
  while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size())), file.gcount() > 0)
    digest.update(buffer.data(), static_cast<std::size_t>(file.gcount()));
  file.clear();
  file.seekg(0);
  return digest.uuid();
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
  const bool counted = box.empty() || (isCountable(box.min()) && isCountable(box.max()));
  if (!stream || !counted) {
    throw DataError(where + ": the metadata " + box_key +
                    " is not six whole numbers from -2^30 "
                    "to 2^30; make the file again");
  }
  return box;
}

/// Refuses a box that is taller than any print: the run would take days to find nothing.
void checkLayers(const Lattice& lattice, const std::string& where) {
  constexpr std::int64_t most = 10'000'000;
  const std::int64_t layers =
      lattice.box.empty() ? 0 : std::int64_t{lattice.box.max().z()} - lattice.box.min().z() + 1;
  if (layers > most) {
    throw DataError(where + " has " + std::to_string(layers) + " layers, and at most " +
                    std::to_string(most) + " are processed; check its box and its grids");
  }
}

/// Pitch and origin of a grid whose transform must only scale and shift.
Lattice plainLatticeOf(const GridBase& grid, const std::string& where) {
  if (const auto lattice = latticeOf(grid)) return *lattice;
  const std::string refused = where + ": grid '" + grid.getName() + "' ";
  if (!grid.transform().isLinear())
    throw DataError(refused + "lies in a frustum; resample it in the tool that it comes from");
  const std::string resample = "resample --grid " + quotedForShell(grid.getName());
  if (const auto voxel_mm = picoGkVoxelMm(grid)) {
    throw DataError(
        refused + "comes from PicoGK, with an identity as its transform and voxels of " +
        shortestText(*voxel_mm) + " mm in its metadata, which " + resample + " honours");
  }
  throw DataError(refused + "is turned, mirrored or sheared; " + resample +
                  " brings it onto the printer's lattice");
}

}  // namespace

std::optional<double> picoGkVoxelMm(const GridBase& grid) {
  constexpr double mm_per_metre = 1000;
  const openvdb::Metadata::ConstPtr stated = grid["PicoGK.VoxelSize"];
  if (!stated || !grid.transform().isIdentity()) return std::nullopt;
  double metres = 0;
  if (const auto* single = dynamic_cast<const openvdb::FloatMetadata*>(stated.get())) {
    // The decimal number that the float stands for: 0.0002 and not 0.000199999995.
    std::array<char, 32> digits{};
    const auto end = std::to_chars(digits.begin(), digits.end(), single->value()).ptr;
    std::from_chars(digits.begin(), end, metres);
  } else if (const auto* number = dynamic_cast<const openvdb::DoubleMetadata*>(stated.get())) {
    metres = number->value();
  }
  if (!std::isfinite(metres) || !(metres > 0)) return std::nullopt;
  return metres * mm_per_metre;
}

std::optional<Lattice> latticeOf(const GridBase& grid) {
  if (!grid.transform().isLinear() || picoGkVoxelMm(grid)) return std::nullopt;
  const openvdb::Mat4d matrix = grid.transform().baseMap()->getAffineMap()->getMat4();
  Lattice lattice;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      if ((row == column) ? !(matrix(row, column) > 0) : matrix(row, column) != 0)
        return std::nullopt;
    }
    if (!std::isfinite(matrix(row, row)) || !std::isfinite(matrix(3, row))) return std::nullopt;
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
      throw DataError(where +
                      " is damaged: its checksum does not match; make it again, and give each run "
                      "a pipe of its own");
    }
  }
  if (bytes.size() < archive_head_size)
    throw DataError(where + " is not a readable VDB archive: it is too short");
  MemoryBuffer buffer(bytes);
  std::istream stream(&buffer);
  return readArchive(stream, bytes.size(), where);
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
    const std::string uuid = uuidOf(file);
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
  std::string head(archive_head_size, 0);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  file.seekg(0);
  // Before OpenVDB sees it, which takes damaged bytes as they are.
  if (statedLength(head) && head.substr(uuid_offset) != uuidOf(file)) {
    throw DataError(quoted(path) + " is damaged: its checksum does not match; make it again");
  }
  return readArchive(file, sizeOf(path), quoted(path));
}

GridConstPtr readGrid(const std::filesystem::path& path, const std::string& name) {
  const VdbContents contents = readVdb(path);
  if (const auto found = contents.grids.find(name); found != contents.grids.end())
    return checked(*found, quoted(path));
  if (contents.grids.size() == 1) return checked(*contents.grids.begin(), quoted(path));
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
    const CoordBBox& box = schema.lattice.box;
    if (!box.empty() && !(isCountable(box.min()) && isCountable(box.max())))
      throw DataError(where +
                      ": its grids have voxels beyond index 2^30; move them nearer to "
                      "index 0 in the tool that they come from");
  }
  for (const char* key : {creator_key, frame_key, run_key}) schema.metadata.erase(key);
  checkLayers(schema.lattice, where);
  return schema;
}

VdbContents contentsOf(const Schema& schema, Grids grids) {
  VdbContents contents{std::move(grids), schema.metadata};
  contents.metadata[box_key] = boxText(schema.lattice.box);
  contents.metadata[creator_key] = "vdbdither";
  return contents;
}

std::optional<ZRange> takeHeldLayers(Schema& schema, const std::string& where) {
  const auto stated = schema.metadata.extract(layers_key);
  if (!stated) return std::nullopt;
  ZRange held;
  std::istringstream text(stated.mapped());
  if (!(text >> held.begin >> held.end) || held.end < held.begin)
    throw DataError(
        where + ": its metadata " + layers_key + " is '" +
        printable(shortened(stated.mapped(), 60)) +
        "'; it must be two whole numbers, the first layer and the end; archive it again");
  return held;
}

}  // namespace vdbdither
