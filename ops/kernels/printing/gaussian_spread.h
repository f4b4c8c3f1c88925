#pragma once

#include <array>
#include <vector>

#include <openvdb/openvdb.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The share of material at every voxel centre after droplets have spread: the printed voxels, each
/// a full box, convolved with a Gaussian.
///
/// Separable; along each axis the weights are the shares of the Gaussian over the voxels within
/// `sigmas` standard deviations, made to sum to one. Sums of floats in rising order of the index, x
/// before y before z. What is within 10⁻⁵ of 0 or 1 counts as that.
class GaussianSpread {
 public:
  /// How many standard deviations the Gaussian reaches.
  static constexpr double sigmas = 4;

  /// `sigma_mm`: standard deviation along each axis; zero leaves an axis as it is.
  GaussianSpread(const openvdb::Vec3d& pitch_mm, const openvdb::Vec3d& sigma_mm);

  /// How many voxels the Gaussian reaches along each axis.
  [[nodiscard]] openvdb::Coord reach() const;

  /// The shares over `core`: a fog volume, canonical, active where not zero.
  /// @param solid   active and true where printed; what lies outside `box` is empty
  /// @param box     of the lattice
  /// @param valid   the layers of `solid` that are there: the core and the reach, cut at the box
  [[nodiscard]] openvdb::FloatGrid::Ptr run(const openvdb::BoolGrid& solid,
                                            const openvdb::CoordBBox& box, ZRange core,
                                            ZRange valid) const;

  /// The weights along an axis, of the voxels from −reach to +reach.
  [[nodiscard]] const std::vector<float>& weights(int axis) const {
    return weights_[static_cast<std::size_t>(axis)];
  }

 private:
  std::array<std::vector<float>, 3> weights_;
};

/// An empty grid `printed`: the share of material, 0 … 1, at least ½ within the print.
openvdb::FloatGrid::Ptr makePrintedGrid(const openvdb::math::Transform& transform);

}  // namespace vdbdither
