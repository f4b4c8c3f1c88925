#include "ops/kernels/colour/empty_colours.h"

#include "vdbdither/model/known_grids.h"

namespace vdbdither {

openvdb::Vec3SGrid::Ptr emptyColours(const Lattice& lattice) {
  auto grid = openvdb::Vec3SGrid::create(openvdb::Vec3s(0, 0, 0));
  grid->setName(colour_grid);
  grid->setVectorType(openvdb::VEC_INVARIANT);
  grid->setTransform(transformOf(lattice));
  return grid;
}

openvdb::FloatGrid::Ptr emptyOpacities(const Lattice& lattice) {
  auto grid = openvdb::FloatGrid::create(0);
  grid->setName(opacity_grid);
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  grid->setTransform(transformOf(lattice));
  return grid;
}

}  // namespace vdbdither
