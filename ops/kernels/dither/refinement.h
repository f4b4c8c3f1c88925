#pragma once

#include <openvdb/openvdb.h>

#include "ops/kernels/dither/block_order.h"
#include "ops/kernels/dither/height_kernel.h"
#include "ops/kernels/dither/open_voxels.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Direct binary search over the printed voxels of a surface: every voxel within k_D of it is
/// toggled, or swapped with one of its 26 neighbours, if this reduces Σ q·q·w over all pairs of
/// voxels. q is the error of a voxel and w what two errors on a facet have in common after the blur
/// of the process; the sum is the integral of the squared height of the printed surface, for a blur
/// of σ and one of 2σ together. One sweep visits every voxel once.
class Refinement {
 public:
  /// \param spread_mm  σ along each axis
  /// \param guarded  keeps thin walls and gaps; see WallGuard
  /// \param sweeps  1 at least
  Refinement(const openvdb::Vec3d& pitch_mm, const openvdb::Vec3d& spread_mm, bool guarded,
             int sweeps);

  /// The layers around a voxel on which its state depends.
  [[nodiscard]] int reachLayers() const;

  /// Returns the printed voxels of `core`.
  ///
  /// \param surface  d in mm; its band must hold k_D
  /// \param normals  the grid `N`, or null to use the gradient
  /// \param solid  the printed voxels to begin with
  /// \param valid  the layers that can be read; others are outside the part
  [[nodiscard]] openvdb::BoolGrid::Ptr run(const openvdb::FloatGrid& surface,
                                           const openvdb::Vec3SGrid* normals,
                                           const openvdb::BoolGrid& solid, ZRange core,
                                           ZRange valid) const;

 private:
  OpenLeaves::Settings settings_;
  int sweeps_;
  HeightKernel kernel_;
  BlockOrder order_;
};

}  // namespace vdbdither
