#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
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

/// The colour of empty voxels in slices, unless the user chooses another.
inline constexpr const char* usual_background = "0,0,0,255";

/// Whether two names of materials are the same, case aside.
bool sameName(std::string_view a, std::string_view b);

/// Returns the material called `name`: the one of just this name or, if there is none, the first of
/// this name case aside; null if there is none either.
const Material* materialCalled(std::string_view name, std::span<const Material> materials);

/// Adds `material` to a table, if it is not there yet, and returns its index, from 1. Throws
/// UsageError where the table has another material of this name, case aside.
std::int32_t addMaterial(MaterialTable& table, const Material& material);

/// Returns why options could not name a material `name`, in words that continue "the name …", or
/// nothing if they can: it may serve as the name of a file, and has letters, digits, `-`, `_` and
/// `.` only.
std::optional<std::string> materialNameProblem(std::string_view name);

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

/// Reads `name`, `name=#rrggbb`, `name=#rrggbbaa`, `name=r,g,b` or `name=r,g,b,a`;
/// materialNameProblem must accept the name. A bare name is looked up as materialCalled does in
/// `known`, then among the usual inks (white, black, clear, cyan, magenta, yellow and their Vero
/// names), case aside. Throws UsageError with what would have been accepted.
Material parseMaterial(std::string_view text, const std::vector<Material>& known);

}  // namespace vdbdither
