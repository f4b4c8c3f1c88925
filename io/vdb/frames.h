#pragma once

#include <optional>

#include "io/vdb/vdb.h"
#include "vdbdither/model/slab.h"

namespace vdbdither {

/// Slabs on a pipe: complete VDB archives end to end. A head without voxels (grids and metadata of
/// the schema), one per slab in rising z, and a closing one with the count of layers, so that a
/// pipe cut short is an error. Every archive carries its digest.
class FrameWriter {
 public:
  /// Writes to the file descriptor; the caller keeps it open. Throws DataError when the reader has
  /// gone.
  explicit FrameWriter(int descriptor) : descriptor_(descriptor) {}

  void head(const Schema& schema);
  void slab(const Slab& slab);
  void end();

 private:
  void send(const VdbContents& contents);

  int descriptor_;
  int layers_ = 0;
};

/// Takes frames off a pipe. An archive that another tool wrote comes as a single slab of all its
/// layers.
class FrameReader {
 public:
  /// `where` names the pipe in messages. Throws DataError for anything that is not a VDB stream.
  FrameReader(int descriptor, const std::string& where);

  [[nodiscard]] const Schema& schema() const { return schema_; }

  /// The next slab, or nothing after the closing frame. Throws DataError when the pipe ended early
  /// or is damaged.
  std::optional<Slab> next();

  /// All that comes, to its end: frames joined to what a file of them would hold, or the single
  /// archive of another tool, whatever its transforms. Throws DataError like `next`.
  static VdbContents readWhole(int descriptor, const std::string& where);

 private:
  /// `first`: the archive that the pipe began with.
  FrameReader(int descriptor, std::string where, VdbContents first);

  int descriptor_;
  std::string where_;
  Schema schema_;
  std::optional<Slab> foreign_;
  bool framed_ = false;
  bool ended_ = false;
  int layers_ = 0;
};

}  // namespace vdbdither
