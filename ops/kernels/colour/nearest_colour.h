#pragma once

#include <optional>

#include <openvdb/Types.h>

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Finds the colours of places at the surface of what is printed.
class NearestColour {
 public:
  explicit NearestColour(const Lattice& lattice) : lattice_(lattice) {}

  /// Adds the colours of the layers above those before; they are kept together with the last.
  void add(openvdb::Vec3SGrid::ConstPtr colours);

  /// Returns the colour of the voxel nearest to `p_mm` that has one, of those at most two voxels
  /// away along every axis.
  [[nodiscard]] std::optional<openvdb::Vec3f> at(const openvdb::Vec3d& p_mm) const;

 private:
  Lattice lattice_;
  openvdb::Vec3SGrid::ConstPtr last_;
  openvdb::Vec3SGrid::ConstPtr before_;
};

}  // namespace vdbdither
