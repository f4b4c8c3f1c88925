#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "io/file/staged_output.h"
#include "io/file/zip.h"

namespace vdbdither {

struct DescribedStack;

/// The name of the file that describes a stack.
inline constexpr const char* manifest_name = "manifest.json";
/// The name of the picture of the whole stack.
inline constexpr const char* preview_name = "preview.png";
/// The ending of the name of a stack that is an archive.
inline constexpr const char* archive_ending = ".zip";

/// Whether a stack of this name is a zip archive and not a folder: it ends with `.zip` or like a
/// container, case aside.
bool namesArchive(const std::filesystem::path& path);

/// The files of a stack of slices on their way to disk: a folder, or an archive where the name says
/// so. It exists under its name only once it is committed.
class StackOutput {
 public:
  /// Checks that `target` can be written. An existing folder must be a stack and hold nothing else
  /// than what its manifest names. Throws UsageError.
  static void check(const std::filesystem::path& target, bool overwrite,
                    const std::function<void(const std::string&)>& warn);

  explicit StackOutput(const std::filesystem::path& target);

  /// Writes a file. `name` is a path below the stack with '/' between folders. Throws DataError.
  void write(const std::string& name, std::span<const std::uint8_t> bytes);
  /// Writes a file whose bytes are those of the file `from`. Throws DataError.
  void copy(const std::string& name, const std::filesystem::path& from);
  /// Completes the stack, to which nothing is written any more. Throws DataError.
  void complete();
  /// Gives the complete stack its name. Throws DataError.
  void commit() { staged_.commit(); }

 private:
  std::filesystem::path shown_;
  StagedOutput staged_;
  std::unique_ptr<ZipWriter> zip_;
};

/// The files of a stack that is there. Their names are paths below the stack with '/' between
/// folders. Symbolic links lead to files of the same stack only.
class StackInput {
 public:
  /// `path`: a stack's folder, its manifest, its zip archive, or a container. Throws DataError.
  explicit StackInput(const std::filesystem::path& path);

  /// The files of a folder or a zip archive that has no manifest. Throws DataError.
  static StackInput withoutManifest(const std::filesystem::path& path);

  /// The first, after a folder that a killed run had put aside is put back, with a warning.
  static StackInput putBack(const std::filesystem::path& path,
                            const std::function<void(const std::string&)>& warn);

  /// The path of the file called `name`, for messages.
  [[nodiscard]] std::string shown(const std::string& name) const;
  /// The name of the manifest among the files, or of what describes a container.
  [[nodiscard]] const std::string& manifestName() const { return manifest_name_; }
  [[nodiscard]] std::string shownManifest() const { return shown(manifest_name_); }
  /// What a container says of itself; nothing where there is a manifest.
  [[nodiscard]] const std::shared_ptr<const DescribedStack>& described() const {
    return described_;
  }
  [[nodiscard]] bool contains(const std::string& name) const;
  /// The names of all files.
  [[nodiscard]] std::vector<std::string> names() const;
  /// Notes a file, which is read only later, as an input; see noteFileRead.
  void noteRead(const std::string& name) const;

  /// Checks that a file that is there can be read: it is an ordinary file of the stack with at most
  /// `most_bytes`. Throws DataError.
  void check(const std::string& name, std::uint64_t most_bytes) const;
  /// Returns the whole file, after the same checks. Safe to call from many threads. Throws
  /// DataError.
  [[nodiscard]] std::vector<std::uint8_t> read(const std::string& name,
                                               std::uint64_t most_bytes) const;

 private:
  StackInput() = default;
  void refuseLinkOutside(const std::string& name) const;

  std::filesystem::path place_;
  std::string manifest_name_;
  std::unique_ptr<ZipReader> zip_;
  std::shared_ptr<const DescribedStack> described_;
};

}  // namespace vdbdither
