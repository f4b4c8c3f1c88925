#pragma once

#include <filesystem>
#include <iosfwd>
#include <map>
#include <optional>
#include <string>

#include "vdbdither/model/schema.h"

namespace vdbdither {

/// The grids and the file metadata of one VDB archive.
struct VdbContents {
  Grids grids;
  std::map<std::string, std::string, std::less<>> metadata;
};

/// Metadata of a file that holds only some layers of its job: the first and the one behind the
/// last.
inline constexpr const char* layers_key = "vdbdither:layers";

/// Metadata of an archive on a pipe: which frame it is, and of which run (frames.h). Not of a job.
inline constexpr const char* frame_key = "vdbdither:frame";
inline constexpr const char* run_key = "vdbdither:run";

/// Metadata of a grid of half floats: its background before it was rounded.
inline constexpr const char* half_background_key = "vdbdither:background";

/// How the voxels of an archive are packed. Inactive values are never stored.
enum class VdbCodec { none, mask, blosc };

/// Prepares OpenVDB (grid types, logging kept off stdout). Called once, before anything else of
/// OpenVDB.
void initializeVdb();

/// Writes one ordinary archive that any OpenVDB tool opens; grids in order of their names. The same
/// contents give the same bytes: the archive's UUID, which OpenVDB draws by chance, is replaced by
/// a digest of everything else and serves as the checksum. Throws DataError naming `shown` when the
/// disk is full or the write fails otherwise.
///
/// `as_half`: numbers with fractions are rounded to 16 bits in the file, to three digits or so.
/// Only the background, which says how far distances reach, stays as it is.
void writeVdb(const std::filesystem::path& path, const VdbContents& contents, VdbCodec codec,
              const std::filesystem::path& shown, bool as_half = false);

/// Reads a whole archive, whatever its grids hold (grid_checks.h), and checks its digest where it
/// carries one. Throws DataError naming `path`, also for an archive that another one follows.
VdbContents readVdb(const std::filesystem::path& path);

/// The grid called `name` of a file; any name where the file has only one grid. Throws DataError,
/// also for a grid that `checkGrid` refuses.
GridConstPtr readGrid(const std::filesystem::path& path, const std::string& name);

/// The archive as bytes, digest included.
std::string archiveBytes(const VdbContents& contents, VdbCodec codec);

/// The edge of a voxel in mm that PicoGK states in the metadata of a grid (`PicoGK.VoxelSize`, in
/// metres), the transform of which it leaves an identity. Nothing of any other grid.
std::optional<double> picoGkVoxelMm(const openvdb::GridBase& grid);

/// Pitch and origin of a grid whose transform only scales and shifts, without a box; nothing of
/// one that is turned, mirrored, sheared, a frustum, or of PicoGK.
std::optional<Lattice> latticeOf(const openvdb::GridBase& grid);

/// The lattice, printer and history that metadata and transforms state. Files of other tools get
/// the lattice of their first grid and the box of their active voxels. Throws DataError if the
/// transform of a grid is not a scaling, or if grids disagree.
Schema schemaOf(const VdbContents& contents, const std::string& where);

/// Removes from `schema` the metadata that says which layers of its job a file holds, and returns
/// the layers, or nothing where the file holds all of them. Throws DataError if it is no range.
std::optional<ZRange> takeHeldLayers(Schema& schema, const std::string& where);

/// Contents that carry `schema`: its metadata, the lattice's box, and the tool's name as `creator`.
VdbContents contentsOf(const Schema& schema, Grids grids);

}  // namespace vdbdither
