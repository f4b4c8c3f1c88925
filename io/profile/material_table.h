#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/printer.h"

namespace vdbdither {

/// The materials of a job: material index i is entry i − 1, as index 0 is empty space.
using MaterialTable = std::vector<Material>;

/// The table as one line of JSON: index, name and display colour of each; and back. Throws
/// DataError.
std::string toJson(const MaterialTable& table);
MaterialTable materialTableFromJson(const std::string& text);

/// Reads `#rrggbb`, `#rrggbbaa`, `r,g,b` or `r,g,b,a`; alpha is 255 unless given. Throws
/// UsageError.
std::array<std::uint8_t, 4> parseColour(std::string_view text);

/// Whether two names of materials are the same, case aside.
bool sameName(std::string_view a, std::string_view b);

/// The entries of a list of materials, which commas part; those between the numbers of a colour do
/// not.
std::vector<std::string> materialEntries(const std::string& text);

/// A layer of a material, as `0.5mm:white` writes it.
struct MaterialLayer {
  double thickness_mm = 0;
  std::string material;
};

/// Reads a layer of more than 0 and up to `thickest_mm`. Throws UsageError that begins with the
/// name of the option and shows `example`.
MaterialLayer parseMaterialLayer(const std::string& option, const std::string& text,
                                 double thickest_mm, const std::string& example);

/// Reads `name`, `name=#rrggbb`, `name=#rrggbbaa`, `name=r,g,b` or `name=r,g,b,a`; names may serve
/// as file names. A bare name is looked up in `known`, then among the usual inks (white, black,
/// clear, cyan, magenta, yellow and their Vero names), case aside. Throws UsageError with what
/// would have been accepted.
Material parseMaterial(std::string_view text, const std::vector<Material>& known);

}  // namespace vdbdither
