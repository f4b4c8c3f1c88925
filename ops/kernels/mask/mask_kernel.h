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
    exponential,  ///< space_weight · exp(-r) + the sum over the three lattice planes of exp(-r)
                  ///< inside the plane; r is the distance to the nearest repetition in units of σ
  };
  Shape shape = Shape::peters;
  /// Standard deviation, or length of decay of `exponential`, along x, y, z, voxels, > 0.
  openvdb::Vec3d sigma{1.1, 1.1, 1.1};
  double plane_sigma = 2.3;  ///< axis_mix: standard deviation inside the planes, voxels, > 0
  double space_weight = 2.0;  ///< axis_mix: weight of N₃; N₂ and N₃ are densities of integral 1.
                              ///< exponential: weight of the distance in space
};

/// A mask kernel on the torus of a periodic tile: summed over all repetitions of the tile and
/// scaled to 1 at the origin. It is computed with +, -, ·, / and square roots alone and so has the
/// same bits on every machine with IEEE doubles.
class ToroidalKernel {
 public:
  /// `size` is the period along x, y, z, each ≥ 1.
  ToroidalKernel(const MaskKernel& kernel, const openvdb::Coord& size);

  /// Returns the kernel at the offset (x, y, z), each in [0, size).
  [[nodiscard]] double operator()(int x, int y, int z) const;

 private:
  /// A product of one factor per axis.
  using Term = std::array<std::vector<double>, 3>;
  std::vector<Term> terms_;  ///< whose sum the kernel is; that of `exponential` has none
  Term square_distances_;    ///< of `exponential`, along each axis, in units of σ
  double space_weight_ = 0;
};

}  // namespace vdbdither
