#pragma once

#include <memory>

#include <openvdb/openvdb.h>

#include "ops/kernels/dither/adapted_amplitude.h"
#include "ops/kernels/mask/threshold_mask.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// An empty grid `displaced`: like `surface` in all but its name.
openvdb::FloatGrid::Ptr makeDisplacedGrid(const openvdb::FloatGrid& surface);

/// Where the threshold M and the voxel's diameter k_D are read for a voxel v.
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
  /// In place of `amplitude`, which then is 2, the constant that no facet exceeds; null: the same
  /// for all.
  std::shared_ptr<const AdaptedAmplitude> adapted = nullptr;
  bool guarded = false;  ///< spares thin walls and gaps: see WallGuard

  /// F: no |f| is greater. Half an amplitude of the largest k_D, which is half a voxel's diagonal.
  [[nodiscard]] double largestDisplacementMm() const { return amplitude * pitch_mm.length() / 4; }

  /// How far v̄ is looked for: F plus one voxel diagonal. Where part and gap are at least a diagonal
  /// thick, the ball of half a diagonal that touches the surface from either side holds a voxel
  /// centre; one of the two balls lies beyond the surface seen from v, within |d| + a diagonal, and
  /// on a staircase of face neighbours from v to that centre the set V begins or ends with a
  /// surface voxel no farther away. Thinner cracks and plates may have none: f is 0 there.
  [[nodiscard]] double searchRadiusMm() const {
    return largestDisplacementMm() + pitch_mm.length();
  }

  /// Layers around a voxel that decide about it.
  struct Layers {
    int surface = 0;
    int normals = 0;  ///< 0 where none are given: they come from the surface
  };
  [[nodiscard]] Layers reach(bool normals_given) const;

  struct Result {
    openvdb::BoolGrid::Ptr solid;       ///< V′
    openvdb::FloatGrid::Ptr displaced;  ///< d′, if asked for: d + f at active voxels, d at others
  };

  /// The printed voxels of `core`.
  ///
  /// f is computed in double precision from single-precision normals and thresholds and rounded to
  /// single once; then d + f < 0 decides, exactly. Inactive voxels and tiles are decided by the
  /// sign of d. A voxel whose v̄ is not found, where there is no normal, or that f would overturn
  /// against the guard has f = 0.
  ///
  /// \param surface  d in mm; its band must hold F
  /// \param normals  `N`, or null: the gradient's
  /// \param valid    the layers that may be read; those beyond count as outside V and inactive
  [[nodiscard]] Result run(const openvdb::FloatGrid& surface, const openvdb::Vec3SGrid* normals,
                           ZRange core, ZRange valid, bool with_displaced) const;
};

}  // namespace vdbdither
