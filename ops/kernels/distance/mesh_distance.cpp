// The layers are divided into blocks of a few rows of leaves, each made from the triangles that can
// reach it.

#include "ops/kernels/distance/mesh_distance.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <openvdb/tools/Prune.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/distance/mesh_distance_block.h"
#include "ops/kernels/leaf/node_writer.h"
#include "ops/kernels/leaf/tie.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

namespace {

constexpr int edge = leaf_layers;

/// The items of every bin, in the order of the entries.
class Bins {
 public:
  struct Entry {
    std::uint32_t bin, item;
  };

  Bins() = default;
  Bins(std::size_t bins, std::span<const Entry> entries) : first_(bins + 1, 0) {
    for (const Entry& entry : entries) ++first_[entry.bin + 1];
    for (std::size_t bin = 0; bin < bins; ++bin) first_[bin + 1] += first_[bin];
    items_.resize(entries.size());
    for (const Entry& entry : entries) items_[first_[entry.bin]++] = entry.item;
    std::copy_backward(first_.begin(), first_.end() - 1, first_.end());
    first_[0] = 0;
  }

  [[nodiscard]] std::span<const std::uint32_t> of(std::size_t bin) const {
    return {items_.data() + first_[bin], first_[bin + 1] - first_[bin]};
  }

 private:
  std::vector<std::uint32_t> first_;
  std::vector<std::uint32_t> items_;
};

/// The tie asked for, within what `mesh` and `lattice` allow.
double tieWithin(const Mesh& mesh, const Lattice& lattice, double asked_mm) {
  // Far above the rounding of products and sums in double precision.
  constexpr double rounding = 0x1p-44;
  double maximum_mm = 0;
  for (const Vec3d& v : mesh.vertices)
    for (int axis = 0; axis < 3; ++axis)
      maximum_mm = std::max(maximum_mm, std::abs(v[axis]) + std::abs(lattice.origin_mm[axis]));
  return std::min(std::max(asked_mm, rounding * maximum_mm), mostTieMm(lattice.pitch_mm));
}

/// Returns the maximum band, in diameters, of the normals whose components are at least `least`.
double bandAcross(const Vec3d& minimum_normal, const Vec3d& pitch_mm) {
  double inverse_diameter = 1 / pitch_mm.length();
  double step_mm = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double u = minimum_normal[(axis + 1) % 3];
    const double v = minimum_normal[(axis + 2) % 3];
    inverse_diameter = std::max(inverse_diameter, minimum_normal[axis] / pitch_mm[axis]);
    step_mm = std::max(step_mm, pitch_mm[axis] * std::sqrt(std::max(0.0, 1 - u * u - v * v)));
  }
  return std::max(1 / inverse_diameter, step_mm);
}

}  // namespace

MeshDistance::MeshDistance(const Mesh& mesh, const Lattice& lattice, Band band,
                           DistanceExtras extras, const SwallowedWalls& walls, double tie_mm)
    : lattice_(lattice),
      band_(band),
      tie_mm_(tieWithin(mesh, lattice, tie_mm)),
      extras_(extras),
      features_(mesh, walls, lattice.origin_mm, lattice.pitch_mm.z() * leaf_layers,
                lattice.pitch_mm.y() * leaf_layers * Block::leaf_rows,
                band.maximumMm(lattice.pitch_mm)) {
  if (band_.mm > 0) return;
  triangle_band_mm_.resize(features_.triangles());
  tbb::parallel_for(std::uint32_t{0}, features_.triangles(), [&](std::uint32_t t) {
    triangle_band_mm_[t] = static_cast<float>(
        bandAcross(features_.minimumNormal(t), lattice_.pitch_mm) * band_.diameters);
  });
  for (const float band_mm : triangle_band_mm_) widest_mm_ = std::max(widest_mm_, double{band_mm});
}

double MeshDistance::memoryBytes() const {
  return static_cast<double>(triangle_band_mm_.capacity() * sizeof(float)) +
         features_.memoryBytes();
}

/// Returns how far along an axis a triangle can affect a voxel: as far as `Block::markBand` looks,
/// and a voxel more because boxes are rounded outwards.
double MeshDistance::reachMm(int axis) const {
  return band_.mm > 0 ? std::max(band_.mm, tie_mm_)
                      : 2 * widest_mm_ + lattice_.diagonalMm() + 2 * lattice_.pitch_mm[axis];
}

void MeshDistance::append(const CoordBBox& voxels, DistanceGrids& grids) const {
  // Blocks and nodes begin at the same places.
  const int first = NodeWriter<openvdb::FloatTree>::parentOf(voxels.min()).y() / edge;
  const auto blocks =
      static_cast<std::uint32_t>(((voxels.max().y() >> 3) - first) / Block::leaf_rows + 1);
  const double block_mm = Block::leaf_rows * edge * lattice_.pitch_mm.y();
  const double first_mm = first * edge * lattice_.pitch_mm.y();
  const auto blockAt = [&](double y) {
    return static_cast<std::uint32_t>(std::clamp((y - first_mm) / block_mm, 0.0, blocks - 1.0));
  };
  std::vector<Bins::Entry> entries;
  for (const std::uint32_t triangle :
       features_.collect(voxels.min().z() * lattice_.pitch_mm.z() - reachMm(2),
                         voxels.max().z() * lattice_.pitch_mm.z() + reachMm(2))) {
    const MeshFeatures::Extent extent = features_.extent(triangle, 1);
    const std::uint32_t end = blockAt(extent.high + reachMm(1));
    for (std::uint32_t block = blockAt(extent.low - reachMm(1)); block <= end; ++block)
      entries.push_back({block, triangle});
  }
  const Bins triangles(blocks, entries);

  std::vector<Block::Made> made(blocks);
  tbb::enumerable_thread_specific<Block::Workspace> workspaces;
  tbb::parallel_for(std::uint32_t{0}, blocks, [&](std::uint32_t block) {
    CoordBBox part = voxels;
    const int begin = (first + static_cast<int>(block) * Block::leaf_rows) * edge;
    part.min().y() = std::max(part.min().y(), begin);
    part.max().y() = std::min(part.max().y(), begin + Block::leaf_rows * edge - 1);
    if (part.empty() || triangles.of(block).empty()) return;
    made[block] = Block(*this, part, workspaces.local()).make(triangles.of(block));
  });

  for (const Block::Made& block : made) {
    for (const Coord& origin : block.parents) {
      NodeWriter<openvdb::FloatTree>::makeParent(grids.surface->tree(), origin);
      if (grids.normals) NodeWriter<openvdb::Vec3STree>::makeParent(grids.normals->tree(), origin);
      if (grids.closest) NodeWriter<openvdb::Int32Tree>::makeParent(grids.closest->tree(), origin);
    }
  }
  // Blocks that share nodes are in the same group.
  constexpr int group_rows = NodeWriter<openvdb::FloatTree>::Parent::DIM / edge;
  const std::uint32_t group_blocks = group_rows / Block::leaf_rows;
  const std::uint32_t groups = (blocks + group_blocks - 1) / group_blocks;
  tbb::parallel_for(std::uint32_t{0}, groups, [&](std::uint32_t group) {
    NodeWriter surface(grids.surface->tree());
    std::optional<NodeWriter<openvdb::Vec3STree>> normals;
    std::optional<NodeWriter<openvdb::Int32Tree>> closest;
    if (grids.normals) normals.emplace(grids.normals->tree());
    if (grids.closest) closest.emplace(grids.closest->tree());
    for (std::uint32_t n = group * group_blocks; n < std::min(blocks, (group + 1) * group_blocks);
         ++n) {
      for (Block::Leaf& leaf : made[n].leaves) {
        if (leaf.normals) normals->set(std::move(leaf.normals));
        if (leaf.closest) closest->set(std::move(leaf.closest));
        surface.set(std::move(leaf.surface));
      }
      for (const LeafSpan& span : made[n].interior) surface.set(span, -grids.surface->background());
      made[n] = {};
    }
  });
}

DistanceGrids MeshDistance::run(ZRange core) const {
  DistanceGrids grids;
  const auto dress = [&](auto grid, const char* name, openvdb::GridClass grid_class) {
    grid->setName(name);
    grid->setGridClass(grid_class);
    grid->setTransform(transformOf(lattice_));
    return grid;
  };
  grids.surface = dress(openvdb::FloatGrid::create(static_cast<float>(backgroundMm())),
                        surface_grid, openvdb::GRID_LEVEL_SET);
  if (extras_.normals) {
    grids.normals = dress(openvdb::Vec3SGrid::create(openvdb::Vec3s(0, 0, 0)), normal_grid,
                          openvdb::GRID_UNKNOWN);
    grids.normals->setVectorType(openvdb::VEC_COVARIANT_NORMALIZE);
  }
  if (extras_.closest)
    grids.closest = dress(openvdb::Int32Grid::create(-1), closest_grid, openvdb::GRID_UNKNOWN);

  if (lattice_.box.empty()) return grids;
  const ZRange layers = intersection(core, lattice_.layers());
  for (int begin = layers.begin; begin < layers.end;) {
    const int end = std::min(layers.end, (begin & ~(edge - 1)) + chunk_layers);
    CoordBBox voxels = lattice_.box;
    voxels.min().z() = begin;
    voxels.max().z() = end - 1;
    append(voxels, grids);
    begin = end;
  }
  openvdb::tools::pruneTiles(grids.surface->tree());
  return grids;
}

}  // namespace vdbdither
