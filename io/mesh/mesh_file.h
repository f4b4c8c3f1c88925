#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

#include <openvdb/Types.h>

#include "io/mesh/file_bytes.h"

namespace vdbdither {

/// Whether the colours of a mesh are read as well. Files that only they need are not looked at
/// otherwise.
enum class MeshColours { skip, read };

/// The content of a mesh file, and how its parser speaks of it: in single lines that start with its
/// name.
class MeshFile {
 public:
  /// @param name   shown in messages; its ending settles what the content leaves open
  /// @param bytes  must outlive the object
  /// @param warn   called with each warning; may be empty
  MeshFile(std::string name, std::string_view bytes, std::function<void(const std::string&)> warn,
           MeshColours colours = MeshColours::skip)
      : name_(std::move(name)), bytes_(bytes), warn_(std::move(warn)), colours_(colours) {}
  /// @param file  must outlive the object
  MeshFile(FileBytes& file, std::function<void(const std::string&)> warn,
           MeshColours colours = MeshColours::skip)
      : name_(file.path()),
        bytes_(file.head()),
        file_(&file),
        warn_(std::move(warn)),
        colours_(colours) {}

  [[nodiscard]] const std::string& name() const { return name_; }
  /// Whether `Mesh::appearance` is wanted.
  [[nodiscard]] bool wantsColours() const { return colours_ == MeshColours::read; }

  [[nodiscard]] std::size_t size() const {
    return file_ != nullptr ? file_->size() : bytes_.size();
  }
  /// The first bytes, of which `bytes` is a continuation at the same address. What they and the
  /// size show to be wrong is refused before the file is read.
  [[nodiscard]] std::string_view head() const { return bytes_; }
  /// All bytes. The first call reads the file; throws DataError.
  [[nodiscard]] std::string_view bytes() const { return file_ != nullptr ? file_->all() : bytes_; }
  /// All bytes without the byte order mark of UTF-8 and without zeros and ^Z at the end, with which
  /// some systems fill up a text. Refuses zeros elsewhere.
  [[nodiscard]] std::string_view text() const;
  /// The head without a byte order mark and the white space at its beginning.
  [[nodiscard]] std::string_view start() const;
  /// Whether the first KiB holds no zero byte.
  [[nodiscard]] bool isText() const;
  /// Whether the name ends like this, case aside.
  /// @param ending  lower case, with its dot
  [[nodiscard]] bool isNamed(std::string_view ending) const;

  void warn(const std::string& what) const;
  void warnAtLine(const char* position, const std::string& what) const;
  [[noreturn]] void refuse(const std::string& why) const;
  [[noreturn]] void refuseAtLine(const char* position, const std::string& why) const;
  [[noreturn]] void refuseAtByte(const char* position, const std::string& why) const;

 private:
  [[nodiscard]] std::string lineOf(const char* position) const;

  std::string name_;
  std::string_view bytes_;  ///< all of them, or the head of `file_`
  FileBytes* file_ = nullptr;
  std::function<void(const std::string&)> warn_;
  MeshColours colours_ = MeshColours::skip;
};

/// Returns `text` in single quotes, fit for one line of a terminal: unprintable bytes become '?',
/// the end of a long text '...'.
std::string inQuotes(std::string_view text);

/// Returns a vertex that is not finite as messages show it: "nan 0 -inf".
std::string shown(const openvdb::Vec3d& position);

bool isFinite(const openvdb::Vec3d& position);

}  // namespace vdbdither
