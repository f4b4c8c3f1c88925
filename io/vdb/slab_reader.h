#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "io/vdb/frames.h"
#include "vdbdither/model/slab.h"

namespace vdbdither {

/// The layers of a .vdb file, or of frames on a pipe, on demand. A file is held whole, a pipe only
/// where it was asked for.
class SlabReader {
 public:
  /// `path`: a .vdb file, a named pipe, or `-` for standard input. `names`: the grids wanted; none:
  /// all. Throws DataError for what cannot be read, UsageError for a grid that is not there.
  SlabReader(std::string path, const std::vector<std::string>& names);
  ~SlabReader();

  [[nodiscard]] const Schema& schema() const { return schema_; }
  [[nodiscard]] bool isPipe() const { return frames_ != nullptr; }
  /// What is held of a file.
  [[nodiscard]] double memoryBytes() const;

  /// The grids over `core`, which rises from call to call on a pipe. Throws DataError where there
  /// are layers missing of it. Safe to call from many threads.
  [[nodiscard]] Grids run(ZRange core);

  /// Reads a pipe to its closing frame and lets go of what is held, once `run` is not to be called
  /// any more. Throws DataError where the frame does not come.
  void drain();

 private:
  void openPipe(int descriptor);
  void openFile(const std::vector<std::string>& names);
  void takeFrames(ZRange core);
  void checkCovered(ZRange core) const;

  std::string path_;
  std::string shown_;  ///< in messages
  int descriptor_ = -1;
  Schema schema_;
  std::unique_ptr<FrameReader> frames_;
  std::mutex mutex_;
  std::vector<Slab> slabs_;
  bool ended_ = false;
};

}  // namespace vdbdither
