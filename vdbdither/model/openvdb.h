#pragma once

// All of OpenVDB that the project uses, as its precompiled header.

#include <openvdb/openvdb.h>

// libopenvdb.so holds these classes whole. Saying so spares every file of ours their virtual
// members: a file that makes grids compiles several times faster.
#define VDBDITHER_EXTERN_GRID(GridT)                                                 \
  extern template class openvdb::tree::Tree<openvdb::GridT::TreeType::RootNodeType>; \
  extern template class openvdb::Grid<openvdb::GridT::TreeType>;

VDBDITHER_EXTERN_GRID(FloatGrid)
VDBDITHER_EXTERN_GRID(DoubleGrid)
VDBDITHER_EXTERN_GRID(Int32Grid)
VDBDITHER_EXTERN_GRID(Int64Grid)
VDBDITHER_EXTERN_GRID(Vec3SGrid)
VDBDITHER_EXTERN_GRID(Vec3DGrid)
VDBDITHER_EXTERN_GRID(BoolGrid)
VDBDITHER_EXTERN_GRID(MaskGrid)

#undef VDBDITHER_EXTERN_GRID
