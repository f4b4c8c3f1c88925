#pragma once

#include <openvdb/openvdb.h>

#include "ops/kernels/dither/block_order.h"
#include "ops/kernels/dither/height_kernel.h"
#include "ops/kernels/dither/open_voxels.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Surface error diffusion: of the voxels within k_D of the surface, in a fixed order, each is
/// printed if t > ½ + Σ q·w. t is its tone; the sum runs over the voxels around it that are decided
/// already; q, printed or not minus the tone, is the error that each left; w is what two errors on
/// a facet have in common after the blur of the process. The rule keeps the integral of the squared
/// height of the printed surface minimal, as far as the voxels decided so far allow.
///
/// Needs neither thresholds nor a table: the result depends on distances, the lattice and the blur.
class ErrorDiffusion {
 public:
  /// \param spread_mm  the standard deviation of the blur along each axis
  /// \param guarded  keeps thin walls and gaps; see WallGuard
  ErrorDiffusion(const openvdb::Vec3d& pitch_mm, const openvdb::Vec3d& spread_mm, bool guarded);

  /// The layers around a voxel on which its state depends.
  [[nodiscard]] int reachLayers() const;

  /// Returns the printed voxels of `core`. The same as those of a larger core, of a surface that is
  /// known in `reachLayers` layers around it.
  ///
  /// \param surface  d in mm; its band must hold k_D
  /// \param normals  the grid `N`, or null to use the gradient
  /// \param valid  the layers that can be read; others are outside the part
  [[nodiscard]] openvdb::BoolGrid::Ptr run(const openvdb::FloatGrid& surface,
                                           const openvdb::Vec3SGrid* normals, ZRange core,
                                           ZRange valid) const;

 private:
  OpenLeaves::Settings settings_;
  HeightKernel kernel_;
  BlockOrder order_;
};

}  // namespace vdbdither
