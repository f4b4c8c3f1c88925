#pragma once

// The printing family: kernels that model the printing process (the spread of droplets) and that
// assign values by depth.

#include <array>
#include <vector>

#include <openvdb/openvdb.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Computes the share of material at every voxel centre after droplets have spread: the printed
/// voxels, each a full box, convolved with a Gaussian.
///
/// The convolution is separable. Along each axis the weights are the shares of the Gaussian over
/// the voxels within `sigmas` standard deviations, scaled to sum to one. Floats are summed in
/// rising order of the index, x before y before z. Shares within 10⁻⁵ of 0 or 1 become 0 or 1.
class GaussianSpread {
 public:
  /// The reach of the Gaussian, in standard deviations.
  static constexpr double sigmas = 4;

  /// `sigma_mm` is the standard deviation along each axis; zero does not blur along the axis.
  GaussianSpread(const openvdb::Vec3d& pitch_mm, const openvdb::Vec3d& sigma_mm);

  /// Returns the reach of the Gaussian in voxels, along each axis.
  [[nodiscard]] openvdb::Coord reach() const;

  /// Returns the shares over `core`: a canonical fog volume, active where it is not zero.
  /// \param solid  active and true where printed; empty outside `box`
  /// \param box  of the lattice
  /// \param valid  the layers of `solid` that exist: the core and the reach, limited to the box
  [[nodiscard]] openvdb::FloatGrid::Ptr run(const openvdb::BoolGrid& solid,
                                            const openvdb::CoordBBox& box, ZRange core,
                                            ZRange valid) const;

  /// The weights along an axis for the voxels from −reach to +reach.
  [[nodiscard]] const std::vector<float>& weights(int axis) const {
    return weights_[static_cast<std::size_t>(axis)];
  }

 private:
  std::array<std::vector<float>, 3> weights_;
};

/// Returns an empty grid `printed`: the share of material, 0 … 1, which is at least ½ within the
/// print.
openvdb::FloatGrid::Ptr makePrintedGrid(const openvdb::math::Transform& transform);

}  // namespace vdbdither
