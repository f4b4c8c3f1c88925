#include "vdbdither/openvdb.h"

// The members of the classes declared in openvdb.h that libopenvdb.so does not hold.
#define VDBDITHER_GRID_TYPE(GridT) \
  template openvdb::Name openvdb::Grid<openvdb::GridT::TreeType>::gridType();

VDBDITHER_GRID_TYPE(FloatGrid)
VDBDITHER_GRID_TYPE(DoubleGrid)
VDBDITHER_GRID_TYPE(Int32Grid)
VDBDITHER_GRID_TYPE(Int64Grid)
VDBDITHER_GRID_TYPE(Vec3SGrid)
VDBDITHER_GRID_TYPE(Vec3DGrid)
VDBDITHER_GRID_TYPE(BoolGrid)
VDBDITHER_GRID_TYPE(MaskGrid)
