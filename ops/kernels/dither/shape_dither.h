#pragma once

// The dither family: kernels that turn distances and thresholds into printed voxels, by shape
// dithering or by interlacing.

#include <openvdb/openvdb.h>

#include "ops/kernels/mask/threshold_mask.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Returns an empty grid `displaced`, otherwise like `surface`.
openvdb::FloatGrid::Ptr makeDisplacedGrid(const openvdb::FloatGrid& surface);

/// The place at which the threshold M and the half diameter k_D are read for a voxel v.
enum class DitherAt {
  closest,  ///< at v̄, the closest surface voxel: eqs. (3)–(6)
  foot,     ///< at the voxel that contains the foot point c(v) − d(v)·n(v)
  voxel,    ///< at v itself: eqs. (1) and (7)
};

/// Implicit shape dithering on one lattice: V′ = { v : d(v) + f < 0 } with f = amplitude·k_D·(M −
/// ½).
struct ShapeDither {
  openvdb::Vec3d pitch_mm;
  double amplitude = 4;  ///< the constant of eq. (5)
  DitherAt at = DitherAt::closest;
  ThresholdMask mask = ThresholdMask::constant(0.5F);
  bool guarded = false;  ///< keeps thin walls and gaps; see WallGuard

  /// F, the maximum |f|: half the amplitude times the largest k_D, which is half a voxel's
  /// diagonal.
  [[nodiscard]] double largestDisplacementMm() const { return amplitude * pitch_mm.length() / 4; }

  /// The radius of the search for v̄: F plus one voxel diagonal. Where part and gap are at least a
  /// diagonal thick, each of the two balls with the diagonal as their diameter that touch the
  /// surface from either side holds a voxel centre. One of the balls lies beyond the surface as
  /// seen from v, within |d| plus a diagonal. On a staircase of face neighbours from v to its voxel
  /// centre the set V begins or ends with a surface voxel, which is no farther away. Thinner cracks
  /// and plates may have none; f is 0 there.
  [[nodiscard]] double searchRadiusMm() const {
    return largestDisplacementMm() + pitch_mm.length();
  }

  /// The layers around a voxel on which its state depends.
  struct Reach {
    int surface = 0;
    int normals = 0;  ///< 0 if none are given: they are computed from the surface
  };
  [[nodiscard]] Reach reach(bool normals_given) const;

  struct Result {
    openvdb::BoolGrid::Ptr solid;       ///< V′
    openvdb::FloatGrid::Ptr displaced;  ///< d′, if requested: d + f at active voxels, d at others
  };

  /// Returns the printed voxels of `core`.
  ///
  /// f is computed in double precision from single-precision normals and thresholds and rounded
  /// once to single precision; then the test d + f < 0 is exact. Inactive voxels and tiles are
  /// decided by the sign of d. f is 0 for a voxel whose v̄ is not found, that has no normal, or
  /// that the guard does not allow to change.
  ///
  /// \param surface  d in mm; its band must hold F
  /// \param normals  the grid `N`, or null to use the gradient
  /// \param valid  the layers that can be read; others count as outside V and inactive
  [[nodiscard]] Result run(const openvdb::FloatGrid& surface, const openvdb::Vec3SGrid* normals,
                           ZRange core, ZRange valid, bool with_displaced) const;
};

}  // namespace vdbdither
