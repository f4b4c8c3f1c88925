#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/mesh/mesh_file.h"

namespace vdbdither {

/// Decodes a URI that carries its data ("data:…;base64,…"). Returns nothing for any other URI, and
/// refuses data that cannot be decoded.
/// @param shown  what messages call it
std::optional<std::vector<std::uint8_t>> decodeDataUri(const MeshFile& file,
                                                       const std::string& shown,
                                                       std::string_view uri);

/// Returns the path that a relative URI stands for. Refuses one with a scheme.
/// @param kind  what messages call it: "buffer"
std::string pathOfUri(const MeshFile& file, std::string_view kind, std::string_view uri);

}  // namespace vdbdither
