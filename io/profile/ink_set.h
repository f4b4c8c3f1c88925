#pragma once

#include <vector>

#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/ink_set.h"
#include "vdbdither/model/schema.h"

namespace vdbdither {

/// Whether a material stands for what is not opaque: its name contains `clear`.
bool isClear(const Material& material);

/// Whether colours can be mixed of all of these materials: at most twelve, of which one is clear or
/// none, and one at least is not.
bool canMixColours(const std::vector<Material>& materials);

/// Returns the materials that `options` name, out of the printer's profile in the metadata of `in`.
/// Where they name none: `usual`, or all of the profile if there are none of these either.
///
/// Throws UsageError for names that are not known, twice there or more than the printer takes, and
/// what readIccCoverages throws.
InkSet inkSetOf(const InkOptions& options, const Schema& in,
                const std::vector<Material>& usual = {});

/// Returns the colours of materials: those that the profile has measured under the same names and
/// display colours, or else their display colours.
std::vector<openvdb::Vec3d> linearColoursOf(const std::vector<Material>& materials,
                                            const PrinterProfile& printer);

}  // namespace vdbdither
