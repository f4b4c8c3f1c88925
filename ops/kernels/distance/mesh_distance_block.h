#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "ops/kernels/distance/leaf_distances.h"
#include "ops/kernels/distance/mesh_distance.h"
#include "ops/kernels/distance/row_crossings.h"
#include "ops/kernels/leaf/node_writer.h"

namespace vdbdither {

/// A few rows of leaves, made by one thread.
class MeshDistance::Block {
 public:
  /// Rows of leaves of a block: enough that few triangles meet two blocks, few enough that the
  /// leaves near a part's surface stay in the cache.
  static constexpr int leaf_rows = LeafDistances::max_rows;

  /// Memory that a thread reuses between blocks.
  struct Workspace {
    LeafDistances distances;
    std::vector<float> bands_mm;  ///< of every leaf; empty if it is the same for all
  };
  struct Leaf {
    std::unique_ptr<openvdb::FloatTree::LeafNodeType> surface;
    std::unique_ptr<openvdb::Vec3STree::LeafNodeType> normals;
    std::unique_ptr<openvdb::Int32Tree::LeafNodeType> closest;
  };
  /// The leaves and tiles of a block.
  struct Made {
    std::vector<Leaf> leaves;
    std::vector<LeafSpan> interior;       ///< leaves wholly inside
    std::vector<openvdb::Coord> parents;  ///< origins of the few nodes above them

    void add(Leaf leaf) {
      noteParent(leaf.surface->origin());
      leaves.push_back(std::move(leaf));
    }
    void add(const LeafSpan& span) {
      const int end = span.origin.x() + span.leaves * leaf_layers;
      for (openvdb::Coord at = NodeWriter<openvdb::FloatTree>::parentOf(span.origin); at.x() < end;
           at.x() += static_cast<int>(NodeWriter<openvdb::FloatTree>::Parent::DIM))
        noteParent(at);
      interior.push_back(span);
    }

   private:
    void noteParent(const openvdb::Coord& xyz) {
      const openvdb::Coord parent = NodeWriter<openvdb::FloatTree>::parentOf(xyz);
      if (std::find(parents.rbegin(), parents.rend(), parent) == parents.rend())
        parents.push_back(parent);
    }
  };

  /// `voxels` are those to make, of the lattice's box.
  Block(const MeshDistance& field, const openvdb::CoordBBox& voxels, Workspace& workspace)
      : field_(field),
        all_(field.features_),
        pitch_mm_(field.lattice_.pitch_mm),
        per_mm_(1.0 / pitch_mm_.x(), 1.0 / pitch_mm_.y(), 1.0 / pitch_mm_.z()),
        voxels_(voxels),
        leaves_(voxels.min() >> 3, voxels.max() >> 3),
        maximum_mm_(field.backgroundMm()),
        low_mm_(voxels.min().asVec3d() * pitch_mm_ - std::max(maximum_mm_, field.tie_mm_)),
        high_mm_(voxels.max().asVec3d() * pitch_mm_ + std::max(maximum_mm_, field.tie_mm_)),
        crossings_(pitch_mm_, field.tie_mm_ / RowCrossings::tie_roundings),
        kernels_(leafKernels()),
        work_(workspace) {}

  /// `triangles` are those that can reach the voxels, in the order of the mesh.
  Made make(std::span<const std::uint32_t> triangles);

 private:
  [[nodiscard]] LeafBits existing(const openvdb::Coord& origin) const;
  [[nodiscard]] openvdb::CoordBBox reachOf(const openvdb::Vec3d& low_mm,
                                           const openvdb::Vec3d& high_mm) const;
  void markBand(std::uint32_t triangle);
  void enter(std::uint32_t triangle);
  void lower(MeshFeatures::Id id, double band_mm);
  [[nodiscard]] Made sweep() const;
  void makeLeaf(const openvdb::Coord& leaf_index, const LeafBits& inside, Made& made) const;
  void addExtras(Leaf& leaf, const std::uint32_t* names) const;

  const MeshDistance& field_;
  const MeshFeatures& all_;
  openvdb::Vec3d pitch_mm_;
  openvdb::Vec3d per_mm_;  ///< voxels
  openvdb::CoordBBox voxels_;
  openvdb::CoordBBox leaves_;
  double maximum_mm_;
  openvdb::Vec3d low_mm_, high_mm_;  ///< the range that can affect the voxels
  RowCrossings crossings_;
  const LeafKernels& kernels_;
  Workspace& work_;
};

}  // namespace vdbdither
