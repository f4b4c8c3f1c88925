#pragma once

#include "vdbdither/model/openvdb.h"

namespace vdbdither {

// Grids of colours that a tree holds as rgba() makes them, in the encoding of sRGB. The active
// voxels are those of the tree, all others are 0. In canonical form.

/// The colours in linear light.
openvdb::Vec3STree::Ptr linearColours(const openvdb::Int32Tree& encoded);

/// Their opacities, 0 … 1.
openvdb::FloatTree::Ptr opacities(const openvdb::Int32Tree& encoded);

}  // namespace vdbdither
