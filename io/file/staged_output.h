#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <set>
#include <span>
#include <string>

namespace vdbdither {

/// A file or folder that exists under its name only once it is complete. It is written as the
/// hidden sibling `.NAME.partial-MACHINE-PID` and renamed at the end; a run that fails removes it,
/// and what a killed run of this machine left behind is removed by the next one that writes the
/// same name. A symbolic link stays, and what it leads to is written.
class StagedOutput {
 public:
  enum class Kind { file, folder };

  /// Returns the paths, below a folder that exists, of the files that an earlier output of the same
  /// kind wrote there. Throws UsageError where that is unknown.
  using OwnFiles = std::function<std::set<std::string>(const std::filesystem::path& folder)>;

  /// Checks that `target` can be written: its parent exists, and it does not exist itself or may be
  /// overwritten (an empty folder always may). Throws UsageError. Without `overwrite`, what another
  /// run writes there from now on is not replaced either.
  static void check(const std::filesystem::path& target, Kind kind, bool overwrite);

  /// Puts back the folder `target` where a killed run had put it aside, with a warning.
  static void putBack(const std::filesystem::path& target,
                      const std::function<void(const std::string&)>& warn);

  /// The same as `check` for a folder, in which an overwriting run deletes `own` files only:
  /// anything else in it is refused. Calls `putBack` first.
  static void checkFolder(const std::filesystem::path& target, bool overwrite, const OwnFiles& own,
                          const std::function<void(const std::string&)>& warn);

  /// Makes the folder, or for a file nothing yet. Throws DataError, and UsageError where this
  /// process is writing the same target already.
  /// @param own  which files of a folder are replaced
  StagedOutput(const std::filesystem::path& target, Kind kind, OwnFiles own = {});
  StagedOutput(const StagedOutput&) = delete;
  StagedOutput& operator=(const StagedOutput&) = delete;
  ~StagedOutput();

  /// Where to write.
  [[nodiscard]] const std::filesystem::path& path() const { return partial_; }

  /// Writes a whole file of the folder, and the folders on its way. Throws DataError naming it as
  /// the user will see it, also where `name` is no path below the folder or is written already.
  void write(const std::string& name, std::span<const std::uint8_t> bytes) const;

  /// Puts the file `from` under a name of the folder too, without a copy of its bytes where both
  /// lie on one file system that can. Throws DataError as `write` does.
  void link(const std::string& name, const std::filesystem::path& from) const;

  /// Waits until all that was written is on the disk. Where a run has several outputs, all are
  /// complete before the first is committed. Throws DataError, and Interrupted if the run is to
  /// stop.
  void complete();

  /// Gives it its name, in place of what had it before, once it is complete: at every moment the
  /// old one or the new one is there, whole, also if the machine stops. (Where the file system
  /// cannot exchange folders, a run that is killed in this moment leaves the old one for
  /// `putBack`.) Files that somebody else put into the old folder since `checkFolder` stay in the
  /// folder. Throws DataError; an output that could not take the place of what is there is then
  /// kept under its name with `.new`. Throws what `complete` throws unless that was called.
  void commit();

  /// Does not wait for the disk in `complete` and `commit` from now on: a machine that stops may
  /// lose outputs that have their names.
  static void leaveFlushOut();

  /// Lets `check` accept what exists from now on, for a process that writes no output.
  static void acceptExisting();

  /// Removes all outputs of the process that are not committed, and lets none be committed or
  /// written to any more: threads that try stay where they are. For a process that ends without
  /// its destructors.
  /// \param patience  how long to wait for a write that is under way, and then to remove files;
  ///                  another process removes those that are left
  static void abandonAll(std::chrono::milliseconds patience);

 private:
  /// The path of a file of the folder, whose own folder is made.
  [[nodiscard]] std::filesystem::path placeOf(const std::string& name) const;
  void begin();
  void removeLeftovers() const;
  void commitFile();
  void commitFolder();
  [[noreturn]] void keepBeside(int error);
  void retire(const std::filesystem::path& old) const;

  std::filesystem::path shown_;   ///< as the user named it
  std::filesystem::path target_;  ///< behind links
  std::filesystem::path partial_;
  Kind kind_;
  OwnFiles own_;
  bool completed_ = false;
  bool committed_ = false;
};

/// Writes `bytes` as the file `path`, called `shown` in errors. Throws DataError when any of it
/// fails.
void writeFile(const std::filesystem::path& path, std::span<const std::uint8_t> bytes,
               const std::filesystem::path& shown);

}  // namespace vdbdither
