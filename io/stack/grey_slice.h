#pragma once

#include <optional>

#include "io/stack/slice_format.h"

namespace vdbdither {

/// Returns the grey levels of a layer, 0 … 255: the share of each voxel that lies within the
/// surface, exact where that is a plane, out of the grids `surface` and `N`. Voxels farther away
/// are full where they are printed.
///
/// @param layout  that of the slices
/// @param dose    ratio of the dose of a full pixel to the minimum dose that hardens the resin. The
///                level of a share s is 255 · dose^(s − 1), which hardens the same share of the
///                depth of the layer. Without it the level is 255 · s
///
/// Source: Jacobs: Rapid Prototyping & Manufacturing, SME 1992, the working curve: the depth of
/// cure rises with the logarithm of the dose.
SpanImage greySlice(const SliceLayer& layer, const SliceLayout& layout,
                    const openvdb::Vec3d& pitch_mm, std::optional<double> dose);

}  // namespace vdbdither
