#include "vdbdither/model/openvdb.h"

#ifdef VDBDITHER_WHOLE_GRIDS
// libopenvdb.so lacks the members that its own compiler put in line everywhere. One that puts less
// in line calls them.
#define VDBDITHER_GRID(GridT)                                                 \
  template class openvdb::tree::Tree<openvdb::GridT::TreeType::RootNodeType>; \
  template class openvdb::Grid<openvdb::GridT::TreeType>;
#else
// The members of the classes declared in openvdb.h that libopenvdb.so does not hold.
#define VDBDITHER_GRID(GridT) \
  template openvdb::Name openvdb::Grid<openvdb::GridT::TreeType>::gridType();
#endif

VDBDITHER_GRID(FloatGrid)
VDBDITHER_GRID(DoubleGrid)
VDBDITHER_GRID(Int32Grid)
VDBDITHER_GRID(Int64Grid)
VDBDITHER_GRID(Vec3SGrid)
VDBDITHER_GRID(Vec3DGrid)
VDBDITHER_GRID(BoolGrid)
VDBDITHER_GRID(MaskGrid)
