#pragma once

#include <array>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// The energy around a set voxel of a mask.
struct MaskKernel {
  enum class Shape {
    peters,  ///< the Gaussian as a filter on the DFT: exp(-2π²σ²f²) up to the Nyquist frequency, so
             ///< with side lobes
    gauss,  ///< the Gaussian exp(-d²/2σ²) sampled at the voxels
    axis_mix,  ///< space_weight · N₃(σ) + the sum over the three lattice planes of N₂(plane_sigma)
               ///< inside the plane
  };
  Shape shape = Shape::peters;
  openvdb::Vec3d sigma{1.1, 1.1, 1.1};  ///< standard deviation along x, y, z, voxels, > 0
  double plane_sigma = 2.3;  ///< axis_mix: standard deviation inside the planes, voxels, > 0
  double space_weight = 2.0;  ///< axis_mix: weight of N₃; N₂ and N₃ are densities of integral 1
};

/// A mask kernel on the torus of a periodic tile: summed over all repetitions of the tile and
/// scaled to 1 at the origin. It is computed with +, -, · and / alone and so has the same bits on
/// every machine with IEEE doubles.
class ToroidalKernel {
 public:
  /// `size` is the period along x, y, z, each ≥ 1.
  ToroidalKernel(const MaskKernel& kernel, const openvdb::Coord& size);

  /// Returns the kernel at the offset (x, y, z), each in [0, size).
  [[nodiscard]] double operator()(int x, int y, int z) const;

 private:
  /// A product of one factor per axis.
  using Term = std::array<std::vector<double>, 3>;
  std::vector<Term> terms_;
};

}  // namespace vdbdither
