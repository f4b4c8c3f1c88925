#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

#include <openvdb/Types.h>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The content of a mesh file, and how its parser speaks of it: in single lines that start with its
/// name.
class MeshFile {
 public:
  /// @param name   shown in messages; its extension settles what the content leaves open
  /// @param bytes  must outlive the object
  MeshFile(std::string name, std::string_view bytes, std::function<void(const std::string&)> warn)
      : name_(std::move(name)), bytes_(bytes), warn_(std::move(warn)) {}

  [[nodiscard]] std::string_view bytes() const { return bytes_; }
  [[nodiscard]] const std::string& name() const { return name_; }

  void warn(const std::string& what) const;
  void warnAtLine(const char* position, const std::string& what) const;
  [[noreturn]] void refuse(const std::string& why) const;
  [[noreturn]] void refuseAtLine(const char* position, const std::string& why) const;
  [[noreturn]] void refuseAtByte(const char* position, const std::string& why) const;

 private:
  [[nodiscard]] std::string lineOf(const char* position) const;

  std::string name_;
  std::string_view bytes_;
  std::function<void(const std::string&)> warn_;
};

/// `text` in single quotes, fit for one line of a terminal: unprintable bytes become '?', the end
/// of a long text '...'.
std::string inQuotes(std::string_view text);

/// What a vertex that is not finite looks like in a message: "nan 0 -inf".
std::string shown(const openvdb::Vec3d& position);

bool isFinite(const openvdb::Vec3d& position);

/// Recognizes the format of `file` and parses it; see readMesh.
Mesh parseMesh(const MeshFile& file);

/// Whether the size is exactly that of a binary STL with as many triangles as its header announces.
bool hasSizeOfBinaryStl(std::string_view bytes);

/// Whether the first statement is one of OBJ's, or there are only comments.
bool looksLikeObj(std::string_view bytes);

/// The parsers. What they return may have no triangles and unused vertices, all else is checked.
Mesh parseBinaryStl(const MeshFile& file);
Mesh parseAsciiStl(const MeshFile& file);
Mesh parseObj(const MeshFile& file);
Mesh parsePly(const MeshFile& file);

}  // namespace vdbdither
