#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/mesh/mesh_file.h"

namespace vdbdither {

/// A file that a mesh file names, such as a texture or a library of materials.
struct SideFile {
  std::string shown;  ///< what messages call it: its name in quotes
  std::vector<std::uint8_t> bytes;

  [[nodiscard]] std::string_view text() const {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
};

/// Reads a file that `file` names. Refuses, in the name of `file`, what lies outside of the folder
/// of `file`, also behind symbolic links, what cannot be read and what is too large.
///
/// @param kind        what messages call it: "texture"
/// @param path        relative to the folder, with `/` or `\`. Where there is no such file, one in
///                    the folder itself with the last component of `path` is taken: exporters leave
///                    paths of their own machine
/// @param most_bytes  its maximum size
SideFile readSideFile(const MeshFile& file, std::string_view kind, std::string_view path,
                      std::uint64_t most_bytes);

/// Whether `readSideFile` finds a file that it may read.
bool hasSideFile(const MeshFile& file, std::string_view path);

}  // namespace vdbdither
