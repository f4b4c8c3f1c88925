#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace vdbdither {

struct Schema;

// The grids of a job by name. Houdini and Blender know these names too. docs/vdb-conventions.md
// lists their types and classes.

inline constexpr const char* surface_grid = "surface";       ///< signed distance, mm; < 0 inside
inline constexpr const char* normal_grid = "N";              ///< unit outward normal
inline constexpr const char* closest_grid = "closest";       ///< index of the nearest triangle
inline constexpr const char* part_grid = "part";             ///< number of the part, from 1
inline constexpr const char* colour_grid = "Cd";             ///< linear red, green, blue
inline constexpr const char* opacity_grid = "Alpha";         ///< opacity, 0 … 1
inline constexpr const char* coverage_prefix = "coverage_";  ///< + name: share of a material
inline constexpr const char* displaced_grid = "displaced";   ///< displaced distance, mm
inline constexpr const char* solid_grid = "solid";           ///< the printed voxels
inline constexpr const char* material_grid = "material";     ///< index of the material; 0 is empty
inline constexpr const char* printed_grid = "printed";       ///< share of material, 0 … 1
inline constexpr const char* mask_grid = "mask";             ///< a periodic tile of thresholds

// Keys of file metadata.

inline constexpr const char* history_key = "vdbdither:history";      ///< one command line per step
inline constexpr const char* printer_key = "vdbdither:printer";      ///< printer profile, JSON
inline constexpr const char* materials_key = "vdbdither:materials";  ///< material table, JSON
inline constexpr const char* creator_key = "creator";                ///< the writing program

/// Key of grid metadata of `part`: the maximum number that its voxels can have.
inline constexpr const char* part_count_key = "vdbdither:parts";

/// Returns `schema` without the grids that describe what the grid `changed` was before, and those
/// that describe these: a changed `surface` has no `solid` yet, and a changed `solid` no
/// `material`.
Schema withoutOutdated(Schema schema, std::string_view changed);

/// The names of the grids of `before` that `after` lacks because a grid that they describe changed.
/// `N` and `closest` are left out: operators find both again where they need them.
std::vector<std::string> outdatedGrids(const Schema& before, const Schema& after);

}  // namespace vdbdither
