#pragma once

#include <optional>
#include <string>

#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/schema.h"

namespace vdbdither {

/// Returns what to ask about a part that is hardly meant to be `size_mm` large: 3 m or more,
/// 0.1 mm or less, or more than the printer in the metadata of `schema` builds. Nothing for any
/// other size.
///
/// \param placement  the unit that was assumed
/// \param is_fitted  whether the size was asked for or the file states it, so that no other unit
///     would change it
/// \param remedy     what helps a part that is larger than the printer
std::optional<std::string> sizeQuestion(const openvdb::Vec3d& size_mm,
                                        const PlacementOptions& placement, bool is_fitted,
                                        const Schema& schema, const std::string& remedy);

/// The same for a part of a few voxels on a lattice of `pitch_mm`: fewer than 10 along its longest
/// side.
std::optional<std::string> fewVoxelsQuestion(const openvdb::Vec3d& size_mm,
                                             const PlacementOptions& placement, bool is_fitted,
                                             const openvdb::Vec3d& pitch_mm);

}  // namespace vdbdither
