#pragma once

#include <algorithm>
#include <cmath>

#include <openvdb/Types.h>

namespace vdbdither {

/// A hole through a shell: a cylinder with flat ends.
struct Drain {
  openvdb::Vec3d centre_mm;
  openvdb::Vec3d direction;  ///< of unit length
  double radius_mm = 0;
  double half_length_mm = 0;

  /// Returns the signed distance to the surface of the cylinder in mm, negative inside; exact.
  [[nodiscard]] double distanceMm(const openvdb::Vec3d& position_mm) const {
    const openvdb::Vec3d from_centre = position_mm - centre_mm;
    const double along_mm = from_centre.dot(direction);
    const double beside_mm = (from_centre - direction * along_mm).length() - radius_mm;
    const double beyond_mm = std::abs(along_mm) - half_length_mm;
    const openvdb::Vec3d outside(std::max(beside_mm, 0.0), std::max(beyond_mm, 0.0), 0);
    return outside.length() + std::min(std::max(beside_mm, beyond_mm), 0.0);
  }
};

}  // namespace vdbdither
