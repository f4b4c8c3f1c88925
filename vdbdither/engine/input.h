#pragma once

#include <string>

#include "vdbdither/model/schema.h"

namespace vdbdither {

/// A file or a pipe that an operator reads layer by layer while the chain runs.
class Input {
 public:
  virtual ~Input() = default;
  /// As the user named it; `-` is standard input.
  [[nodiscard]] virtual const std::string& path() const = 0;
  [[nodiscard]] virtual bool isPipe() const = 0;
  [[nodiscard]] virtual const Schema& schema() const = 0;
  /// The bytes it holds in memory.
  [[nodiscard]] virtual double memoryBytes() const = 0;

  /// Returns the grids over `core`, which must rise from call to call on a pipe. Throws DataError
  /// if layers of it are missing. Safe to call from many threads.
  virtual Grids read(ZRange core) = 0;

  /// Reads a pipe to its end, so that its writer finishes cleanly, and releases the memory. Called
  /// once, after the last `read`. Throws DataError if the pipe breaks off.
  virtual void readToEnd() = 0;
};

}  // namespace vdbdither
