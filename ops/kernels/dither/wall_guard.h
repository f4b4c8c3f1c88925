#pragma once

#include <array>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/leaf_surroundings.h"
#include "vdbdither/model/instruction_set.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Decides which voxels dithering may change without opening a thin wall or closing a thin gap.
///
/// Let τ = Σ|n_a|·pitch_a, the maximum change of the depth below a flat face from a voxel to one of
/// its 26 neighbours, and T the local thickness of the part, or of the gap. A voxel at the distance
/// d may be changed if
///
/// 1. |d| + k_D + τ ≤ T on both sides of the face. As |d| < k_D, the slab that dithering cannot
///    reach, deeper than |d| from both faces, is at least as thick as the longest step between
///    neighbours, so that no path of neighbours (by faces, edges or corners) crosses it. In walls
///    between parallel faces dithering therefore opens no tunnel that plain voxelization does not
///    have, and joins nothing that it keeps apart; walls thinner than k_D + τ do not change.
///    T is measured at the voxel centre v ∓ m·e, where e is one voxel along every axis in which the
///    normal has a component. This centre is m·τ deeper, so T = −d(v) + m·τ − d(v − m·e): exact
///    where the centre lies beyond the wall's middle, too small otherwise. m is the smallest number
///    that distinguishes a thick wall. Nothing is interpolated.
/// 2. the surface is a single sheet here: the distance of every neighbour that is, or should be,
///    closer to the surface than k_D differs from that to a flat face by no more than it would on a
///    face of the radius 0.3 mm. This detects the ends of bars, tips, wires and sharp edges, where
///    T cannot be measured along the normal.
///
/// Both rules are the same on the two sides of a face, so that walls and wires keep their volume. A
/// sample outside the band counts as if it were at the end of a band of one diameter.
class WallGuard {
 public:
  /// `surface` holds d in mm; layers outside `valid` are outside the part.
  WallGuard(const openvdb::FloatTree& surface, const openvdb::Vec3d& pitch_mm, float background_mm,
            ZRange valid, InstructionSet instructions = bestInstructionSet());

  /// Whether the voxel at `offset` in the leaf at `origin`, whose surroundings are `around`, may be
  /// changed. Its distance is `d_mm` from a face with this normal, and `half_diameter_mm` is k_D.
  [[nodiscard]] bool allows(const LeafSurroundings& around, const openvdb::Coord& origin,
                            unsigned offset, const openvdb::Vec3s& normal, float d_mm,
                            double half_diameter_mm);

  /// The maximum number of layers to a sample, for displacements up to ½·amplitude·k_D.
  static int reachLayers(double amplitude) {
    return 1 + static_cast<int>(0.375 * amplitude + 0.96);
  }

 private:
  struct Flat;
  struct Loops;

  /// The neighbours of a voxel by rows of three along z; the fourth of each row is idle. There is
  /// one row more, the same as the last, so that two rows can be read at a time.
  static constexpr std::size_t rows = 10;

  /// Returns d of a voxel, infinite if it is unknown.
  double distance(const openvdb::Coord& ijk);

  openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> surface_;
  openvdb::Vec3d pitch_mm_;
  double background_mm_;
  ZRange valid_;
  std::array<float, 4 * rows> apart2_{};  ///< |Δ|² of the neighbours, in mm²
  bool (*is_bent_)(const Flat& flat, const float* here);
};

}  // namespace vdbdither
