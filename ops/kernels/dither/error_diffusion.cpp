// Error diffusion goes back to Floyd and Steinberg: An Adaptive Algorithm for Spatial Greyscale,
// Proceedings of the Society for Information Display 17(2), 1976. The error is weighed as direct
// binary search weighs it: Analoui, Allebach: Model-based halftoning using direct binary search,
// SPIE 1666, 1992.

#include "ops/kernels/dither/error_diffusion.h"

#include "ops/kernels/dither/open_surroundings.h"
#include "ops/kernels/leaf/solid.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// The maximum distance of two voxels that count for each other, in σ.
constexpr double reach_in_spreads = 3.3;

/// Only the voxels decided before count, on one side of each; the errors of those that follow are
/// open. A factor above one makes up for them.
constexpr double feedback = 1.15;

/// Slightly wider hills than those of σ serve a process that is blunter than stated, too.
constexpr double width = 1.15;

/// Decides the voxels of a leaf in the order of the leaf.
void diffuse(OpenLeaf& leaf, OpenSurroundings& around) {
  leaf.forEachOpen([&](unsigned offset, OpenVoxel& voxel) {
    const openvdb::Coord ijk = leaf.origin + FloatLeaf::offsetToLocalCoord(offset);
    const bool free = bitAt(leaf.free, offset);
    bool printed = bitAt(leaf.printed, offset);
    if (free) printed = voxel.tone > 0.5F + around.sum(ijk, voxel.depth);
    setBit(leaf.printed, offset, printed);
    voxel.setPrinted(printed, free);
    around.set(ijk, voxel.error);
  });
  leaf.decided = true;
}

}  // namespace

ErrorDiffusion::ErrorDiffusion(const Vec3d& pitch_mm, const Vec3d& spread_mm, bool guarded)
    : settings_{pitch_mm, spread_mm, guarded},
      kernel_(pitch_mm, spread_mm, {{width, feedback}}, reach_in_spreads),
      order_(kernel_.reach()) {}

int ErrorDiffusion::reachLayers() const {
  return order_.reachLayers() + OpenLeaves::reachLayers(settings_.guarded);
}

openvdb::BoolGrid::Ptr ErrorDiffusion::run(const openvdb::FloatGrid& surface,
                                           const openvdb::Vec3SGrid* normals, ZRange core,
                                           ZRange valid) const {
  OpenLeaves leaves(surface, normals, settings_, order_, intersection(order_.needed(core), valid),
                    valid);
  leaves.visitInOrder(order_.needed(core), [&] {
    return [find = OpenLeaves::Finder(leaves),
            around = OpenSurroundings(kernel_, order_)](OpenLeaves::Block block) mutable {
      around.visit(block, find);
      for (OpenLeaf* leaf : block) diffuse(*leaf, around);
    };
  });
  return makeSolidGrid(surface.transform(), leaves.printed(core),
                       insideTiles(surface.tree(), core));
}

}  // namespace vdbdither
