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

}  // namespace

double SurfaceOffset::greatestMm() const {
  double minimum = constant_mm - grid_limit_mm;
  double maximum = constant_mm + grid_limit_mm;
  if (map) {
    minimum += map->leastMm();
    maximum += map->greatestMm();
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
  std::vector<LeafValues> leaves(sources.size());
  std::atomic<float> maximum = 0;

  /// `make_reader()` returns, for one thread, a function from a leaf, an offset and d to h.
  const auto displace = [&](const auto& make_reader) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, sources.size()), [&](const auto& range) {
      const Accessor accessor(surface.tree());
      auto reader = make_reader();
      LeafSurroundings around(surface.tree(), valid);
      for (std::size_t n = range.begin(); n != range.end(); ++n) {
        leaves[n] = LeafValues::of(accessor, origins[n]);
        const std::uint8_t within = rowWithin(origins[n].z(), core);
        LeafBits active = leaves[n].active;
        for (std::uint64_t& word : active) word &= everyRow(within);
        reader.visit(*sources[n]);
        LeafBits ties{};
        forEachBit(active, [&](unsigned offset) {
          float& d = leaves[n].distance[offset];
          d = static_cast<float>(double{d} - reader(offset, d));
          ties[offset / 64] |= std::uint64_t{std::abs(d) < moved_tie_mm} << (offset % 64);
        });
        if (varies() || ties == no_bits) continue;
        around.visit(*sources[n], ties);
        forEachBit(ties, [&](unsigned offset) {
          const int trend = trendOfTie(around.at(offset), lattice.pitch_mm);
          leaves[n].distance[offset] = trend < 0 ? -tied_mm : tied_mm;
        });
      }
    });
  };

  if (!varies()) {
    struct Constant {
      double height_mm;
      void visit(const FloatLeaf&) {}
      double operator()(unsigned, float) { return height_mm; }
    };
    displace([&] { return Constant{constant_mm}; });
  } else if (at == At::foot) {
    struct AtFoot {
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
    displace([&] {
      return AtFoot{LeafNormals(surface.tree(), lattice.pitch_mm, valid), *this,
                    std::make_shared<Heights>(*this, heights, maximum)};
    });
  } else {
    const SearchDisk disk(lattice.pitch_mm, searchRadiusMm());
    const FloatTree of_surface = surfaceHeights(
        *this, surface.tree(), heights, grownWithin(core, disk.halo().z(), valid), valid, maximum);
    struct AtClosest {
      double constant_mm;
      ClosestSurfaceVoxel closest;
      bool any = false;
      void visit(const FloatLeaf& leaf) { any = closest.visit(leaf.origin()); }
      double operator()(unsigned n, float) {
        const auto found = any ? closest(n) : std::nullopt;
        return found ? double{found->value} : constant_mm;
      }
    };
    displace([&] { return AtClosest{constant_mm, ClosestSurfaceVoxel(of_surface, disk)}; });
  }
  if (from_grid && !(double{maximum.load()} <= grid_limit_mm * (1 + 1e-6)))
    throw DataError("the grid of offsets holds one of " + std::to_string(maximum.load()) +
                    " mm, and --most is " + std::to_string(grid_limit_mm) + " mm");
  return surfaceOf(surface, backgroundMm(), core, origins, leaves,
                   insideTiles(surface.tree(), core));
}

}  // namespace vdbdither
