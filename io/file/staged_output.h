#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <span>

namespace vdbdither {

/// A file or folder that exists under its name only once it is complete. It is written as the
/// hidden sibling `.NAME.partial-PID` and renamed at the end; a run that fails removes it, and what
/// a killed run left behind is removed by the next one that writes the same name.
class StagedOutput {
 public:
  enum class Kind { file, folder };

  /// Whether `target` can be written: its parent exists, and it does not exist itself or may be
  /// overwritten (an empty folder always may). Throws UsageError.
  static void check(const std::filesystem::path& target, Kind kind, bool overwrite);

  /// Makes the folder, or for a file nothing yet. Throws DataError.
  StagedOutput(const std::filesystem::path& target, Kind kind);
  StagedOutput(const StagedOutput&) = delete;
  StagedOutput& operator=(const StagedOutput&) = delete;
  ~StagedOutput();

  /// Where to write.
  [[nodiscard]] const std::filesystem::path& path() const { return partial_; }

  /// Writes a whole file of the folder, and the folders on its way. Throws DataError naming it as
  /// the user will see it.
  void write(const std::filesystem::path& name, std::span<const std::uint8_t> bytes) const;

  /// Gives it its name, in place of what had it before: at every moment the old one or the new one
  /// is there, whole. Throws Interrupted if the run is to stop.
  void commit();

  /// Removes all outputs of the process that are not committed, and lets none be committed or
  /// written to any more: threads that try stay where they are. For a process that ends without
  /// its destructors.
  /// \param patience  how long to wait for a write that is under way
  static void abandonAll(std::chrono::milliseconds patience);

 private:
  void removeLeftovers() const;
  void forget() const;

  std::filesystem::path target_;
  std::filesystem::path partial_;
  bool committed_ = false;
};

/// Writes `bytes` as the file `path`, called `shown` in errors. Throws DataError when any of it
/// fails.
void writeFile(const std::filesystem::path& path, std::span<const std::uint8_t> bytes,
               const std::filesystem::path& shown);

}  // namespace vdbdither
