#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "io/mesh/mesh_file.h"

namespace vdbdither {

/// A material of an MTL file, as far as it says what colour a surface has.
struct MtlMaterial {
  std::string name;
  std::array<double, 3> diffuse{1, 1, 1};  ///< encoded as sRGB, 0 … 1
  double opacity = 1;
  std::string texture;  ///< the path of map_Kd as it is in the file; empty without one
  std::array<double, 2> offset{0, 0};  ///< a point (u, v) lies at scale · (u, v) + offset
  std::array<double, 2> scale{1, 1};
  bool is_clamped = false;
};

/// Parses a library of materials. What it does not know is passed over with a warning of `file`.
/// Throws DataError for colours and opacities that are no numbers from 0 up.
/// @param text   the library
/// @param shown  what messages call it
std::vector<MtlMaterial> parseMtl(const MeshFile& file, std::string_view text,
                                  const std::string& shown);

/// Returns a name that goes on to the end of its line, without blanks around it and without a
/// comment: '#' begins one at the start or behind a blank.
std::string_view mtlName(std::string_view line);

/// Returns a name without the quotes around it.
std::string_view unquoted(std::string_view name);

}  // namespace vdbdither
