#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/file/staged_output.h"
#include "io/stack/zip.h"

namespace vdbdither {

/// The name of the file that describes a stack.
inline constexpr const char* manifest_name = "manifest.json";

/// The files of a stack of slices on their way to disk: a folder, or a zip archive where the name
/// ends with `.zip`. It exists under its name only once it is complete.
class StackOutput {
 public:
  /// Whether `target` can be written. A folder that holds something else than a stack never can.
  /// Throws UsageError.
  static void check(const std::filesystem::path& target, bool overwrite);

  explicit StackOutput(const std::filesystem::path& target);

  /// Throws DataError.
  void write(const std::string& name, std::span<const std::uint8_t> bytes);
  void commit();

 private:
  StagedOutput staged_;
  std::unique_ptr<ZipWriter> zip_;
};

/// The files of a stack that is there.
class StackInput {
 public:
  /// `path`: a stack's folder, its manifest, or its zip archive. Throws DataError.
  explicit StackInput(const std::filesystem::path& path);

  /// The path of the file called `name`, for messages.
  [[nodiscard]] std::string shown(const std::string& name) const;
  [[nodiscard]] bool contains(const std::string& name) const;
  /// Safe to call from many threads. Throws DataError.
  [[nodiscard]] std::vector<std::uint8_t> read(const std::string& name) const;

 private:
  std::filesystem::path place_;
  std::unique_ptr<ZipReader> zip_;
};

}  // namespace vdbdither
