#pragma once

#include <optional>

#include "io/vdb/vdb.h"
#include "vdbdither/model/slab.h"

namespace vdbdither {

/// Slabs on a pipe: complete VDB archives end to end. A head without voxels (grids and metadata of
/// the schema), one per slab in rising z, and a closing one with the count of layers, so that a
/// pipe cut short is an error. Every archive carries its digest, and every one behind the head the
/// id of the run, which is the UUID of the head.
class FrameWriter {
 public:
  /// Writes to the file descriptor; the caller keeps it open. Throws DataError when the reader has
  /// gone.
  explicit FrameWriter(int descriptor) : descriptor_(descriptor) {}

  void head(const Schema& schema);
  void slab(const Slab& slab);
  void end();

 private:
  /// Returns the UUID of the archive.
  std::string send(const VdbContents& contents);

  int descriptor_;
  std::string run_;
  int layers_ = 0;
};

/// Takes frames off a pipe. An archive that another tool wrote comes as a single slab of all its
/// layers.
class FrameReader {
 public:
  /// `where` names the pipe in messages. Throws DataError for anything that is not a VDB stream,
  /// and for a single archive that is followed by more bytes.
  FrameReader(int descriptor, const std::string& where);

  /// Throws DataError if the grids do not lie on one lattice, or `checkGrids` refuses them.
  const Schema& schema();

  /// The next slab, or nothing after the closing frame, which ends the pipe. Throws DataError when
  /// the pipe ended early, goes on, is damaged, or holds frames of several runs.
  std::optional<Slab> next();

  /// All that comes, to its end: frames joined to what a file of them would hold, or the single
  /// archive of another tool, whatever its transforms. Throws DataError like `next`.
  static VdbContents readWhole(int descriptor, const std::string& where);

 private:
  /// `first`: the bytes of the archive that the pipe began with.
  FrameReader(int descriptor, std::string where, const std::string& first);

  int descriptor_;
  std::string where_;
  std::string run_;
  VdbContents whole_;  ///< the first archive, until the schema is made of it
  std::optional<Schema> schema_;
  std::optional<Slab> foreign_;
  bool framed_ = false;
  bool ended_ = false;
  int layers_ = 0;
  std::optional<int> next_layer_;
};

}  // namespace vdbdither
