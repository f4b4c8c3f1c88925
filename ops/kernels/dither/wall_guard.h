#pragma once

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/leaf_surroundings.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Says which voxels may be overturned without opening a thin wall or closing a thin gap.
///
/// Let τ = Σ|n_a|·pitch_a, the most that the depth below a flat face changes from a voxel to one of
/// its 26 neighbours, and T the local thickness of the part, or of the gap. A voxel at the distance
/// d may be overturned where
///
/// 1. |d| + k_D + τ ≤ T on both sides of the face. |d| < k_D, so what no dither may touch, the slab
///    deeper than |d| from both faces, is at least as thick as the longest step between neighbours:
///    no path of neighbours, by faces, edges or corners, leads through it. So in walls between
///    parallel faces no tunnel is opened that plain voxelization has not, and what it keeps apart
///    between such faces is not joined; walls thinner than k_D + τ stay as they are.
///    T is measured at the voxel centre v ∓ m·e, where e steps by one voxel along every axis that
///    the normal has a part in: m·τ deeper, so T = −d(v) + m·τ − d(v − m·e), exact where that
///    centre lies beyond the wall's middle and less than T otherwise. m is the least that still
///    tells a thick wall. Nothing is interpolated.
/// 2. the surface is one sheet here: no neighbour that is or should be closer to the surface than
///    k_D differs in its distance from the flat face by more than one bent to a radius of 0.3 mm
///    would. This is what tells the ends of bars, tips, wires and sharp edges, where T is not to be
///    had along the normal.
///
/// Both rules are alike on the two sides of a face, so walls and wires keep their volume. Where a
/// sample lies outside the band, it counts as at the end of a band of one diameter.
class WallGuard {
 public:
  /// `surface`: d in mm; layers outside `valid` are outside the part.
  WallGuard(const openvdb::FloatTree& surface, const openvdb::Vec3d& pitch_mm, float background_mm,
            ZRange valid)
      : surface_(surface), pitch_mm_(pitch_mm), background_mm_(background_mm), valid_(valid) {}

  /// Whether the voxel at `offset` in the leaf that `around` is about, at the distance `d_mm` from
  /// a face with this normal, may be overturned. `origin`: the leaf's.
  [[nodiscard]] bool allows(const LeafSurroundings& around, const openvdb::Coord& origin,
                            unsigned offset, const openvdb::Vec3s& normal, float d_mm);

  /// How many layers away a sample may be, for displacements up to ½·amplitude·k_D.
  static int reachLayers(double amplitude) {
    return 1 + static_cast<int>(0.375 * amplitude + 0.96);
  }

 private:
  /// d of a voxel; infinite where it has none.
  double distance(const openvdb::Coord& ijk);

  openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> surface_;
  openvdb::Vec3d pitch_mm_;
  double background_mm_;
  ZRange valid_;
};

}  // namespace vdbdither
