#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "io/vdb/frames.h"
#include "vdbdither/engine/input.h"

namespace vdbdither {

/// The layers of a .vdb file, or of frames on a pipe, on demand. A file is held whole; of a pipe,
/// only the slabs that the last call asked for.
class SlabReader : public Input {
 public:
  /// \param path   a .vdb file, a named pipe, or `-` for standard input
  /// \param names  the grids to read; empty: all
  ///
  /// Throws DataError if the archive cannot be read, UsageError if a grid is missing.
  SlabReader(std::string path, const std::vector<std::string>& names);
  ~SlabReader() override;
  SlabReader(const SlabReader&) = delete;
  SlabReader& operator=(const SlabReader&) = delete;

  [[nodiscard]] const std::string& path() const override { return path_; }
  [[nodiscard]] bool isPipe() const override { return frames_ != nullptr; }
  [[nodiscard]] const Schema& schema() const override { return schema_; }
  [[nodiscard]] double memoryBytes() const override;
  /// A grid of a file as the file holds it, before the first `read`; null on a pipe.
  [[nodiscard]] GridConstPtr held(const std::string& name) const;
  Grids read(ZRange core) override;
  void readToEnd() override;

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
