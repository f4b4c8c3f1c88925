#include "vdbdither/model/openvdb.h"

// libopenvdb.so lacks the members that its own compiler put in line everywhere. What another
// compiler puts in line differs with its options and the size of a source.
#define VDBDITHER_GRID(GridT)                                                 \
  template class openvdb::tree::Tree<openvdb::GridT::TreeType::RootNodeType>; \
  template class openvdb::Grid<openvdb::GridT::TreeType>;

VDBDITHER_GRID(FloatGrid)
VDBDITHER_GRID(DoubleGrid)
VDBDITHER_GRID(Int32Grid)
VDBDITHER_GRID(Int64Grid)
VDBDITHER_GRID(Vec3SGrid)
VDBDITHER_GRID(Vec3DGrid)
VDBDITHER_GRID(BoolGrid)
VDBDITHER_GRID(MaskGrid)
