#include "ops/kernels/colour/nearest_colour.h"

#include <limits>
#include <utility>

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;
using openvdb::Vec3SGrid;

void NearestColour::add(Vec3SGrid::ConstPtr colours) {
  before_ = std::exchange(last_, std::move(colours));
}

std::optional<openvdb::Vec3f> NearestColour::at(const Vec3d& p_mm) const {
  const Coord middle = Coord::round((p_mm - lattice_.origin_mm) / lattice_.pitch_mm);
  std::optional<openvdb::Vec3f> nearest;
  double least = std::numeric_limits<double>::infinity();
  for (int reach = 1; reach <= 2 && !nearest; ++reach) {
    for (const Vec3SGrid* grid : {last_.get(), before_.get()}) {
      if (grid == nullptr) continue;
      const Vec3SGrid::ConstAccessor colours = grid->getConstAccessor();
      for (const Coord& ijk : openvdb::CoordBBox(middle.offsetBy(-reach), middle.offsetBy(reach))) {
        openvdb::Vec3s colour;
        if (!colours.probeValue(ijk, colour)) continue;
        const double distance = (lattice_.position(ijk) - p_mm).lengthSqr();
        if (distance >= least) continue;
        least = distance;
        nearest = colour;
      }
    }
  }
  return nearest;
}

}  // namespace vdbdither
