// Brunton, Abu Rmaileh: "Displaced signed distance fields for additive manufacturing", ACM
// Transactions on Graphics 40(4), 2021.

#include "ops/kernels/distance/surface_offset.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "ops/kernels/distance/closest_surface_voxel.h"
#include "ops/kernels/distance/gradient.h"
#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/solid.h"
#include "ops/kernels/leaf/surface_leaves.h"
#include "ops/kernels/leaf/tie.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Vec3d;

namespace {

using Accessor = openvdb::tree::ValueAccessor<const FloatTree, false>;

/// Reads h at a voxel or at a point, for one thread.
class Heights {
 public:
  Heights(const SurfaceOffset& offset, const FloatGrid* grid, std::atomic<float>& maximum)
      : offset_(offset), maximum_(maximum) {
    if (grid) grid_.emplace(grid->tree());
  }
  Heights(Heights&&) = default;
  ~Heights() {
    float known = maximum_.load();
    while (known < seen_ && !maximum_.compare_exchange_weak(known, seen_)) {
    }
  }

  double at(const Coord& ijk) { return at(ijk, offset_.lattice.position(ijk)); }

  /// Returns h at a point in the voxel `ijk`.
  double at(const Coord& ijk, const Vec3d& position_mm) {
    double height_mm = offset_.constant_mm;
    if (offset_.map) height_mm += offset_.map->at(position_mm);
    if (grid_) {
      const float value = grid_->getValue(ijk);
      seen_ = std::max(
          seen_, std::isnan(value) ? std::numeric_limits<float>::infinity() : std::abs(value));
      height_mm += double{value};
    }
    return height_mm;
  }

 private:
  const SurfaceOffset& offset_;
  std::optional<Accessor> grid_;
  std::atomic<float>& maximum_;
  float seen_ = 0;
};

/// Returns h on ∂V, active at its voxels.
FloatTree surfaceHeights(const SurfaceOffset& offset, const FloatTree& surface,
                         const FloatGrid* grid, ZRange layers, ZRange valid,
                         std::atomic<float>& maximum) {
  FloatTree heights(0.0F);
  addLeaves(heights, leavesIn(surface, layers), [&] {
    return
        [surface_voxels = SurfaceVoxels(surface, valid),
         read = std::make_shared<Heights>(offset, grid, maximum)](const FloatLeaf& leaf) mutable {
          const LeafBits bits = surface_voxels(leaf);
          if (bits == no_bits) return std::unique_ptr<FloatLeaf>();
          auto made = std::make_unique<FloatLeaf>(leaf.origin(), 0.0F);
          forEachBit(bits, [&](unsigned n) {
            made->setValueOn(n, static_cast<float>(read->at(leaf.offsetToGlobalCoord(n))));
          });
          return made;
        };
  });
  return heights;
}

/// h where it is the same everywhere. This and the classes below return h for the voxels of one
/// leaf after another.
struct ConstantHeight {
  double height_mm;
  void visit(const FloatLeaf&) {}
  double operator()(unsigned, float) const { return height_mm; }
};

/// h at the foot point of a voxel.
struct HeightAtFoot {
  LeafNormals normals;
  const SurfaceOffset& offset;
  std::shared_ptr<Heights> heights;
  const FloatLeaf* leaf = nullptr;

  void visit(const FloatLeaf& next) {
    leaf = &next;
    normals.visit(next, activeBits(next, 0xff));
  }
  double operator()(unsigned n, float d) {
    const Vec3d normal(normals.normal(n));
    if (normal == Vec3d(0.0)) return offset.constant_mm;
    const Coord ijk = leaf->offsetToGlobalCoord(n);
    const Vec3d steps = normal * double{-d} / offset.lattice.pitch_mm;
    return heights->at(ijk + Coord::floor(steps + 0.5),
                       offset.lattice.position(ijk) + steps * offset.lattice.pitch_mm);
  }
};

/// h at the closest surface voxel.
struct HeightAtClosest {
  double constant_mm;
  ClosestSurfaceVoxel closest;
  bool any = false;

  void visit(const FloatLeaf& leaf) { any = closest.visit(leaf.origin()); }
  double operator()(unsigned n, float) {
    const auto found = any ? closest(n) : std::nullopt;
    return found ? double{found->value} : constant_mm;
  }
};

/// Returns the leaves with d − h for their active voxels of `core`. `make_heights()` returns one of
/// the classes above for one thread.
template <typename MakeHeights>
std::vector<LeafValues> displaced(const FloatTree& surface,
                                  const std::vector<const FloatLeaf*>& sources, ZRange core,
                                  const MakeHeights& make_heights) {
  std::vector<LeafValues> leaves(sources.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, sources.size()), [&](const auto& range) {
    const Accessor accessor(surface);
    auto height = make_heights();
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      const Coord origin = sources[n]->origin();
      leaves[n] = LeafValues::of(accessor, origin);
      LeafBits active = leaves[n].active;
      for (std::uint64_t& word : active) word &= everyRow(rowWithin(origin.z(), core));
      height.visit(*sources[n]);
      forEachBit(active, [&](unsigned offset) {
        float& d = leaves[n].distance[offset];
        d = static_cast<float>(double{d} - height(offset, d));
      });
    }
  });
  return leaves;
}

/// Gives the voxels that a displaced surface passes through the sign that the distances around them
/// ask for.
void settleTies(const FloatTree& surface, const std::vector<const FloatLeaf*>& sources, ZRange core,
                ZRange valid, const Vec3d& pitch_mm, std::vector<LeafValues>& leaves) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, sources.size()), [&](const auto& range) {
    LeafSurroundings around(surface, valid);
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      LeafBits ties{};
      forEachBit(leaves[n].active, [&](unsigned offset) {
        const bool tie = std::abs(leaves[n].distance[offset]) < moved_tie_mm;
        ties[offset / 64] |= std::uint64_t{tie} << (offset % 64);
      });
      for (std::uint64_t& word : ties) word &= everyRow(rowWithin(sources[n]->origin().z(), core));
      if (ties == no_bits) continue;
      around.visit(*sources[n], ties);
      forEachBit(ties, [&](unsigned offset) {
        const int trend = trendOfTie(around.at(offset), pitch_mm);
        leaves[n].distance[offset] = trend < 0 ? -tied_mm : tied_mm;
      });
    }
  });
}

}  // namespace

double SurfaceOffset::maximumMm() const {
  double minimum = constant_mm - grid_limit_mm;
  double maximum = constant_mm + grid_limit_mm;
  if (map) {
    minimum += map->minimumMm();
    maximum += map->maximumMm();
  }
  return std::max(std::abs(minimum), std::abs(maximum));
}

SurfaceOffset::Reach SurfaceOffset::reach() const {
  if (!varies()) return {1, 0};  // for ties
  if (at == At::foot) {
    const int steps = static_cast<int>(std::ceil(held_mm / lattice.pitch_mm.z() + 0.5));
    return {1, from_grid ? steps : 0};
  }
  const int steps = SearchDisk(lattice.pitch_mm, searchRadiusMm()).halo().z();
  return {steps + 1, from_grid ? steps : 0};
}

FloatGrid::Ptr SurfaceOffset::run(const FloatGrid& surface, const FloatGrid* heights, ZRange core,
                                  ZRange valid) const {
  const std::vector<const FloatLeaf*> sources = leavesIn(surface.tree(), core);
  std::vector<Coord> origins;
  origins.reserve(sources.size());
  for (const FloatLeaf* leaf : sources) origins.push_back(leaf->origin());
  std::atomic<float> maximum = 0;

  std::vector<LeafValues> leaves;
  if (!varies()) {
    leaves = displaced(surface.tree(), sources, core, [&] { return ConstantHeight{constant_mm}; });
    settleTies(surface.tree(), sources, core, valid, lattice.pitch_mm, leaves);
  } else if (at == At::foot) {
    leaves = displaced(surface.tree(), sources, core, [&] {
      return HeightAtFoot{LeafNormals(surface.tree(), lattice.pitch_mm, valid), *this,
                          std::make_shared<Heights>(*this, heights, maximum)};
    });
  } else {
    const SearchDisk disk(lattice.pitch_mm, searchRadiusMm());
    const FloatTree of_surface = surfaceHeights(
        *this, surface.tree(), heights, grownWithin(core, disk.halo().z(), valid), valid, maximum);
    leaves = displaced(surface.tree(), sources, core, [&] {
      return HeightAtClosest{constant_mm, ClosestSurfaceVoxel(of_surface, disk)};
    });
  }
  if (from_grid && !(double{maximum.load()} <= grid_limit_mm * (1 + 1e-6)))
    throw DataError("the grid of offsets holds a value of " + std::to_string(maximum.load()) +
                    " mm; --most allows " + std::to_string(grid_limit_mm) + " mm");
  return surfaceOf(surface, backgroundMm(), core, origins, leaves,
                   insideTiles(surface.tree(), core));
}

}  // namespace vdbdither
