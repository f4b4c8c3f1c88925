// Eqs. (1)–(7) of Morsy, Brunton, Urban: Shape Dithering for 3D Printing, ACM Transactions on
// Graphics 41(4), 2022.

#include "ops/kernels/dither/shape_dither.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>

#include "ops/kernels/distance/closest_surface_voxel.h"
#include "ops/kernels/distance/gradient.h"
#include "ops/kernels/dither/voxel_normals.h"
#include "ops/kernels/dither/wall_guard.h"
#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/solid.h"
#include "ops/kernels/leaf/voxel_diameter.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::FloatTree;
using openvdb::Vec3d;
using openvdb::Vec3s;
using openvdb::Vec3STree;

namespace {

/// Returns f by eq. (5).
float displacement(const ShapeDither& dither, const Vec3s& normal, const Coord& ijk) {
  const double half_diameter = halfVoxelDiameter(normal, dither.pitch_mm);
  return static_cast<float>(dither.amplitude * half_diameter * (double{dither.mask(ijk)} - 0.5));
}

/// Returns f on ∂V, active at its voxels. A leaf's transient data holds the bits of its maximum
/// |f|.
FloatTree surfaceDisplacements(const ShapeDither& dither, const FloatTree& surface,
                               const Vec3STree* normals, ZRange layers, ZRange valid) {
  FloatTree displacements(0.0F);
  addLeaves(displacements, leavesIn(surface, layers), [&] {
    return [&, surface_voxels = SurfaceVoxels(surface, valid),
            gradient = LeafNormals(surface, dither.pitch_mm, valid),
            given = normals ? std::optional<NormalAccessor>(*normals)
                            : std::nullopt](const FloatLeaf& leaf) mutable {
      const LeafBits bits = surface_voxels(leaf);
      if (bits == no_bits) return std::unique_ptr<FloatLeaf>();

      if (!given) gradient.visit(leaf, bits);
      auto made = std::make_unique<FloatLeaf>(leaf.origin(), 0.0F);
      float maximum = 0;
      forEachBit(bits, [&](unsigned offset) {
        const Coord ijk = leaf.offsetToGlobalCoord(offset);
        const Vec3s normal = given                    ? given->getValue(ijk)
                             : leaf.isValueOn(offset) ? gradient.normal(offset)
                                                      : Vec3s(0.0F);
        const float f = displacement(dither, normal, ijk);
        maximum = std::max(maximum, std::abs(f));
        made->setValueOn(offset, f);
      });
      made->setTransientData(std::bit_cast<std::uint32_t>(maximum));
      return made;
    };
  });
  return displacements;
}

/// Computes f one leaf at a time, by where it is read: `visit` returns a bound of |f| in the leaf,
/// and `operator()` returns f at an active voxel. `overturnable` returns the undecided voxels whose
/// sign f may change.
class AtClosest {
 public:
  AtClosest(const FloatTree& displacements, const SearchDisk& disk)
      : closest_(displacements, disk) {}

  float visit(const FloatLeaf& leaf) {
    float maximum = 0;
    if (!closest_.visit(leaf.origin())) return maximum;
    for (const FloatLeaf* near : closest_.leaves()) {
      if (near) maximum = std::max(maximum, std::bit_cast<float>(near->transientData()));
    }
    return maximum;
  }

  static LeafBits overturnable(const LeafBits& undecided) { return undecided; }

  float operator()(unsigned offset, float) {
    const auto found = closest_(offset);
    return found ? found->value : 0.0F;
  }

 private:
  ClosestSurfaceVoxel closest_;
};

class AtFoot {
 public:
  AtFoot(const ShapeDither& dither, const Vec3STree& normals)
      : dither_(dither), normals_(normals) {}

  /// F, plus a margin for the rounding of normals and f.
  float visit(const FloatLeaf& leaf) {
    leaf_ = &leaf;
    return static_cast<float>(dither_.largestDisplacementMm() * (1 + 1e-6));
  }

  static LeafBits overturnable(const LeafBits& undecided) { return undecided; }

  float operator()(unsigned offset, float d) {
    Coord ijk = leaf_->offsetToGlobalCoord(offset);
    const Vec3s normal = normals_.getValue(ijk);
    for (int axis = 0; axis < 3; ++axis) {
      ijk[axis] +=
          static_cast<int>(std::floor(0.5 - double{d} * normal[axis] / dither_.pitch_mm[axis]));
    }
    return displacement(dither_, normals_.getValue(ijk), ijk);
  }

 private:
  const ShapeDither& dither_;
  NormalAccessor normals_;
  const FloatLeaf* leaf_ = nullptr;
};

class AtVoxel {
 public:
  AtVoxel(const ShapeDither& dither, VoxelNormals& normals) : dither_(dither), normals_(normals) {}

  float visit(const FloatLeaf& leaf) {
    leaf_ = &leaf;
    return static_cast<float>(dither_.largestDisplacementMm() * (1 + 1e-6));
  }

  LeafBits overturnable(const LeafBits& undecided) {
    return normals_.within(undecided, dither_.amplitude / 2);
  }

  float operator()(unsigned offset, float) {
    return displacement(dither_, normals_(offset), leaf_->offsetToGlobalCoord(offset));
  }

 private:
  const ShapeDither& dither_;
  VoxelNormals& normals_;
  const FloatLeaf* leaf_ = nullptr;
};

/// No displacement: plain voxelization.
struct Nowhere {
  float visit(const FloatLeaf&) { return 0; }
  static LeafBits overturnable(const LeafBits&) { return no_bits; }
  float operator()(unsigned, float) { return 0; }
};

}  // namespace

openvdb::FloatGrid::Ptr makeDisplacedGrid(const openvdb::FloatGrid& surface) {
  auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(surface.copyGridWithNewTree());
  grid->setName(displaced_grid);
  grid->setTransform(surface.transform().copy());
  return grid;
}

ShapeDither::Reach ShapeDither::reach(bool normals_given) const {
  if (amplitude == 0) return {};
  Reach reach;
  if (at == DitherAt::closest) reach.normals = SearchDisk(pitch_mm, searchRadiusMm()).halo().z();
  if (at == DitherAt::foot)
    reach.normals = static_cast<int>(std::ceil(largestDisplacementMm() / pitch_mm.z() + 0.5));
  // One more for the neighbours that decide whether a voxel is a surface voxel, and for the
  // gradient.
  if (at == DitherAt::closest || !normals_given) reach.surface = reach.normals + 1;
  if (guarded) reach.surface = std::max(reach.surface, WallGuard::reachLayers(amplitude));
  return reach;
}

ShapeDither::Result ShapeDither::run(const openvdb::FloatGrid& surface,
                                     const openvdb::Vec3SGrid* normals, ZRange core, ZRange valid,
                                     bool with_displaced) const {
  const std::vector<const FloatLeaf*> leaves = leavesIn(surface.tree(), core);
  std::vector<SolidLeaf> printed(leaves.size());
  const auto displaced = with_displaced ? makeDisplacedGrid(surface) : nullptr;
  if (displaced) displaced->setTree(std::make_shared<FloatTree>(surface.tree()));

  const Vec3STree* given = normals ? &normals->tree() : nullptr;
  const auto decide = [&](const auto& make_reader) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.size()), [&](const auto& range) {
      VoxelNormals voxel_normals(surface.tree(), pitch_mm, given, valid);
      auto f = make_reader(voxel_normals);
      WallGuard guard(surface.tree(), pitch_mm, surface.background(), valid);
      for (std::size_t n = range.begin(); n != range.end(); ++n) {
        const FloatLeaf& leaf = *leaves[n];
        const float* distances = leaf.buffer().data();
        const std::uint8_t within = rowWithin(leaf.origin().z(), core);
        FloatLeaf* moved = displaced ? displaced->tree().probeLeaf(leaf.origin()) : nullptr;
        const float f_bound = f.visit(leaf);
        const float bound = moved ? std::numeric_limits<float>::infinity() : f_bound;

        LeafBits inside = insideBits(leaf, within);
        const LeafBits undecided = bandBits(leaf, bound, within);
        voxel_normals.visit(leaf, undecided);
        LeafBits overturned{};
        forEachBit(moved ? undecided : f.overturnable(undecided), [&](unsigned offset) {
          const float plain = distances[offset];
          const float d = plain + f(offset, plain);
          overturned[offset / 64] |= std::uint64_t{(d < 0) != (plain < 0)} << (offset % 64);
          if (moved) moved->setValueOnly(offset, d);
        });
        if (guarded) {
          forEachBit(overturned, [&](unsigned offset) {
            const float plain = distances[offset];
            const Vec3s normal = voxel_normals(offset);
            if (guard.allows(voxel_normals.around(), leaf.origin(), offset, normal, plain,
                             halfVoxelDiameter(normal, pitch_mm)))
              return;
            overturned[offset / 64] &= ~(std::uint64_t{1} << (offset % 64));
            if (moved) moved->setValueOnly(offset, plain);
          });
        }
        for (unsigned x = 0; x < 8; ++x) inside[x] ^= overturned[x];
        printed[n] = {leaf.origin(), inside};
      }
    });
  };

  const int halo = reach(true).normals;
  if (amplitude == 0) {
    decide([](VoxelNormals&) { return Nowhere(); });
  } else if (at == DitherAt::closest) {
    const SearchDisk disk(pitch_mm, searchRadiusMm());
    const FloatTree displacements =
        surfaceDisplacements(*this, surface.tree(), given, grownWithin(core, halo, valid), valid);
    decide([&](VoxelNormals&) { return AtClosest(displacements, disk); });
  } else if (at == DitherAt::foot) {
    const auto made =
        given ? nullptr : outwardNormals(surface, pitch_mm, grownWithin(core, halo, valid), valid);
    decide([&](VoxelNormals&) { return AtFoot(*this, given ? *given : made->tree()); });
  } else {
    decide([&](VoxelNormals& voxel_normals) { return AtVoxel(*this, voxel_normals); });
  }

  return {makeSolidGrid(surface.transform(), printed, insideTiles(surface.tree(), core)),
          displaced};
}

}  // namespace vdbdither
