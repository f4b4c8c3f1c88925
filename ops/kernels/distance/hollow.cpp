#include "ops/kernels/distance/hollow.h"

#include <cmath>
#include <vector>

#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/surface_leaves.h"
#include "ops/kernels/leaf/tie.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;

namespace {

/// Returns the drains that are nearer than `band_mm` to a voxel of the leaf.
std::vector<Drain> drainsNear(std::span<const Drain> drains, const Lattice& lattice,
                              const Coord& origin, double band_mm) {
  const Vec3d half_mm = 0.5 * (leaf_layers - 1) * lattice.pitch_mm;
  const Vec3d middle_mm = lattice.position(origin) + half_mm;
  std::vector<Drain> near;
  for (const Drain& drain : drains) {
    if (drain.distanceMm(middle_mm) < half_mm.length() + band_mm) near.push_back(drain);
  }
  return near;
}

/// The voxels of the leaf on the inner surface.
LeafBits tiesUnder(const FloatLeaf& leaf, double thickness_mm, ZRange core) {
  const LeafBits active = activeBits(leaf, rowWithin(leaf.origin().z(), core));
  LeafBits ties{};
  forEachBit(active, [&](unsigned offset) {
    const double under = -(double{leaf.buffer().data()[offset]} + thickness_mm);
    ties[offset / 64] |= std::uint64_t{std::abs(under) < moved_tie_mm} << (offset % 64);
  });
  return ties;
}

}  // namespace

openvdb::FloatGrid::Ptr hollowed(const openvdb::FloatGrid& surface, const Lattice& lattice,
                                 double thickness_mm, std::span<const Drain> drains,
                                 float background_mm, ZRange core, ZRange valid) {
  const std::vector<const FloatLeaf*> sources = leavesIn(surface.tree(), core);
  std::vector<Coord> origins;
  origins.reserve(sources.size());
  for (const FloatLeaf* leaf : sources) origins.push_back(leaf->origin());
  std::vector<LeafValues> leaves(sources.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, sources.size()), [&](const auto& range) {
    const openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> accessor(surface.tree());
    LeafSurroundings around(surface.tree(), valid);
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      const LeafBits ties = tiesUnder(*sources[n], thickness_mm, core);
      if (ties != no_bits) around.visit(*sources[n], ties);
      LeafValues& values = leaves[n];
      values = LeafValues::of(accessor, origins[n]);
      const std::vector<Drain> near = drainsNear(drains, lattice, origins[n], background_mm);
      for (unsigned offset = 0; offset < 512; ++offset) {
        const double d = values.distance[offset];
        double under = -(d + thickness_mm);
        if ((ties[offset / 64] >> (offset % 64) & 1U) != 0)
          under = trendOfTie(around.at(offset), lattice.pitch_mm) > 0 ? -tied_mm : tied_mm;
        double shell = std::max(d, under);
        // Where the distance is unknown only the side is: outside the part, or in the cavity.
        if (!(values.active[offset / 64] >> (offset % 64) & 1U)) shell = background_mm;
        for (const Drain& drain : near) {
          const double beside =
              -drain.distanceMm(lattice.position(sources[n]->offsetToGlobalCoord(offset)));
          shell = std::max(shell, beside);
        }
        values.distance[offset] = static_cast<float>(shell);
      }
    }
  });
  return surfaceOf(surface, background_mm, core, origins, leaves, {});
}

}  // namespace vdbdither
