#include "ops/kernels/distance/zero_set_distance.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <openvdb/tools/Prune.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/leaf/solid.h"
#include "ops/kernels/leaf/tie.h"

namespace vdbdither {

using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Vec3d;

namespace {

Band widened(const Band& band, const Vec3d& pitch_mm, double slack_mm) {
  const double minimum_mm = std::min({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()});
  return band.mm > 0 ? Band{0, band.mm + slack_mm}
                     : Band{band.diameters + slack_mm / minimum_mm, 0};
}

/// What single precision leaves open of positions in such a box.
double tieOf(const ZeroSet::Bounds& bounds, const Vec3d& pitch_mm) {
  double maximum_mm = 0;
  for (int axis = 0; axis < 3; ++axis)
    maximum_mm = std::max({maximum_mm, std::abs(bounds.min[axis]), std::abs(bounds.max[axis])});
  return std::min(0x1p-20 * maximum_mm, mostTieMm(pitch_mm));
}

int chunkOf(int layer, int layers) { return (layer - (layer < 0 ? layers - 1 : 0)) / layers; }

}  // namespace

ZeroSetDistance::ZeroSetDistance(std::shared_ptr<const ZeroSet> surface, const Lattice& lattice,
                                 const Band& band, double slack_mm)
    : surface_(std::move(surface)),
      lattice_(lattice),
      wide_(widened(band, lattice.pitch_mm, slack_mm)),
      tie_mm_(tieOf(surface_->bounds(), lattice.pitch_mm)) {}

std::shared_ptr<const MeshDistance> ZeroSetDistance::chunk(int index) const {
  const std::lock_guard lock(mutex_);
  if (last_ && last_index_ == index) return last_;
  // More than a feature's reach in MeshDistance.
  const double around_mm = 2 * backgroundMm() + 3 * lattice_.diagonalMm();
  const double low_mm = index * chunk_layers * lattice_.pitch_mm.z() + lattice_.origin_mm.z();
  const Mesh mesh = surface_->triangles(low_mm - around_mm,
                                        low_mm + chunk_layers * lattice_.pitch_mm.z() + around_mm);
  last_ = std::make_shared<MeshDistance>(mesh, lattice_, wide_, DistanceExtras{true},
                                         SwallowedWalls{}, tie_mm_);
  last_index_ = index;
  return last_;
}

FloatGrid::Ptr ZeroSetDistance::run(ZRange core) const {
  const ZRange layers = intersection(core, lattice_.layers());
  FloatGrid::Ptr result;
  for (int begin = layers.begin; begin < layers.end;) {
    const int index = chunkOf(begin, chunk_layers);
    const ZRange range = intersection(layers, {begin, (index + 1) * chunk_layers});
    const DistanceGrids made = chunk(index)->run(range);
    correct(*made.surface, *made.normals);
    if (!result) {
      result = made.surface;
    } else {
      // Chunks share no leaf, so that the tree is still empty there.
      for (const openvdb::CoordBBox& box : insideTiles(made.surface->tree(), range))
        result->tree().sparseFill(box, -result->background(), false);
      std::vector<FloatTree::LeafNodeType*> leaves;
      made.surface->tree().stealNodes(leaves);
      for (FloatTree::LeafNodeType* leaf : leaves) result->tree().addLeaf(leaf);
    }
    begin = range.end;
  }
  if (!result) return MeshDistance(Mesh{}, lattice_, wide_).run({0, 0}).surface;
  openvdb::tools::prune(result->tree());
  return result;
}

void ZeroSetDistance::correct(FloatGrid& surface, const openvdb::Vec3SGrid& normals) const {
  std::vector<FloatTree::LeafNodeType*> leaves;
  surface.tree().getNodes(leaves);
  const float background = surface.background();
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.size()), [&](const auto& range) {
    ZeroSet::Feet feet(*surface_);
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      FloatTree::LeafNodeType& leaf = *leaves[n];
      const auto* directions = normals.tree().probeConstLeaf(leaf.origin());
      if (!directions) continue;
      for (auto voxel = leaf.beginValueOn(); voxel; ++voxel) {
        const Vec3d position = lattice_.position(voxel.getCoord());
        const Vec3d foot = position - Vec3d(directions->getValue(voxel.pos())) * double{*voxel};
        auto corrected = static_cast<float>(feet.distanceMm(position, foot, double{*voxel}));
        if (std::abs(corrected) < tie_mm_)
          corrected = tieIsInside(Vec3d(directions->getValue(voxel.pos()))) ? -tied_mm : tied_mm;
        if (std::abs(corrected) < background) {
          voxel.setValue(corrected);
        } else {
          leaf.setValueOff(voxel.pos(), std::copysign(background, corrected));
        }
      }
    }
  });
}

}  // namespace vdbdither
