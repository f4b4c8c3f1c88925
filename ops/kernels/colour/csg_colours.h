#pragma once

#include "ops/kernels/distance/csg.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// The colours, or opacities, of the combination of two parts on one lattice.
///
/// A voxel has the value of the part whose surface is the nearer one; inside both parts of a union,
/// that of the first, or of b if `b_first`. Inside both where it has none, it has that of the other
/// part. A part without colours gives none.
///
/// @param a, b         distances
/// @param of_a, of_b   the values; null for a part that has none
template <class GridT>
typename GridT::Ptr combinedValues(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b,
                                   const GridT* of_a, const GridT* of_b, Csg operation,
                                   bool b_first, ZRange core);

}  // namespace vdbdither
