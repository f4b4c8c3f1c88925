#pragma once

#include <vector>

#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/ink_set.h"
#include "vdbdither/model/schema.h"

namespace vdbdither {

/// Returns the materials that `options` name, out of the printer's profile in the metadata of `in`.
///
/// Throws UsageError for names that are not known, twice there or more than the printer takes, and
/// what readIccCoverages throws.
InkSet inkSetOf(const InkOptions& options, const Schema& in);

/// Returns the colours of materials: those that the printer's profile in the metadata of `in` has
/// measured under the same names, or else their display colours.
std::vector<openvdb::Vec3d> linearColoursOf(const std::vector<Material>& materials,
                                            const Schema& in);

/// Returns the factors n of Yule and Nielsen of the printer's profile in the metadata of `in`; 2
/// where there is none.
openvdb::Vec3d yuleNielsenOf(const Schema& in);

}  // namespace vdbdither
