#pragma once

#include <openvdb/openvdb.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Moves the surface where the printing process loses detail, so that the print has the intended
/// shape: d′(v) = d(v) − e, where e is the distance by which the print misses the surface at the
/// foot of v, positive where material is missing.
///
/// The process is a Gaussian blur of the printed voxels, and the print is where the blur is at
/// least ½. The part's coverage of each voxel, that of a half space by the distance and normal of
/// its centre, is blurred to b. In front of a flat face the distance of the print is −σ·Φ⁻¹(b), so
/// e = −σ·Φ⁻¹(b) at the foot v − d·n. A second step does the same with the coverage of d′.
///
/// Guarantees:
/// - |e| ≤ 2·k_D, the voxel's diameter along the normal.
/// - e = 0 and the bits of d stay where the print misses by less than `quiet_share`·σ, which is the
///   case on flat faces and on surfaces whose radius exceeds some 20 σ.
/// - Only simple points change their side, one after another, so that the voxels inside keep their
///   topology: nothing fuses, nothing opens, and nothing floats.
/// - The surface stays away from the medial axis on the side that it moves to, measured along the
///   normal: it keeps half of the way there and half a step between neighbours, so that gaps and
///   walls stay in the print as well.
/// - Voxels without a usable normal, such as those in the middle of a gap, do not change.
/// - Up to 3·k_D from the surface the whole e counts; from there it falls to zero at 7·k_D, so that
///   d′ rises steadily and the band stays what it was.
struct DetailCompensation {
  /// Where the print misses by less than this share of σ, nothing changes; from `loud_share` on the
  /// whole distance counts.
  static constexpr double quiet_share = 0.08;
  static constexpr double loud_share = 0.2;

  Lattice lattice;
  openvdb::Vec3d spread_mm;  ///< σ along each axis
  int steps = 2;             ///< 1 or 2

  /// The layers around a voxel on which d′ depends.
  [[nodiscard]] int reachLayers() const;

  /// Returns d′ over `core`, with the background, the name and the metadata of `surface`. Voxels
  /// next to its band become active where the surface moves towards them.
  /// \param surface  d in mm, active within a voxel diameter of the surface at least
  /// \param valid  the layers that can be read: the core and the reach, limited to the box; others
  ///               are outside the part
  [[nodiscard]] openvdb::FloatGrid::Ptr run(const openvdb::FloatGrid& surface, ZRange core,
                                            ZRange valid) const;
};

}  // namespace vdbdither
