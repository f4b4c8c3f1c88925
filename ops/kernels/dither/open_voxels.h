#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <openvdb/openvdb.h>
#include <tbb/enumerable_thread_specific.h>

#include "ops/kernels/dither/block_order.h"
#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/solid.h"

namespace vdbdither {

/// The bit of the voxel at `offset`.
inline bool bitAt(const LeafBits& bits, unsigned offset) {
  return (bits[offset / 64] >> (offset % 64) & 1) != 0;
}

/// Sets it without a branch, which would be mispredicted.
inline void setBit(LeafBits& bits, unsigned offset, bool value) {
  std::uint64_t& word = bits[offset / 64];
  word &= ~(std::uint64_t{1} << (offset % 64));
  word |= std::uint64_t{value} << (offset % 64);
}

/// A voxel that can be printed or not: |d| < k_D.
struct OpenVoxel {
  float depth;  ///< d/σ, with the blur σ along the normal of the facet
  float tone;   ///< the share that is to be printed of voxels like this one
  float error;  ///< printed or not, 1 or 0, minus the tone, once this is decided; 0 if held

  /// Sets the error. A voxel that the guard holds passes none on: at an edge of the part, its
  /// neighbours on flat faces would make up for it with bumps.
  void setPrinted(bool printed, bool free) {
    error = free ? static_cast<float>(static_cast<int>(printed)) - tone : 0.0F;
  }
};

/// Memory for the open voxels of many leaves.
class OpenVoxelStore {
 public:
  /// Returns room for `count` voxels, 512 at most.
  OpenVoxel* reserve(std::size_t count) {
    if (left_ < count) {
      chunks_.push_back(std::make_unique_for_overwrite<OpenVoxel[]>(chunk));
      next_ = chunks_.back().get();
      left_ = chunk;
    }
    return next_;
  }
  /// Keeps the first `count` of the voxels for which there is room.
  std::span<OpenVoxel> keep(std::size_t count) {
    left_ -= count;
    return {std::exchange(next_, next_ + count), count};
  }

 private:
  static constexpr std::size_t chunk = 8192;
  std::vector<std::unique_ptr<OpenVoxel[]>> chunks_;
  OpenVoxel* next_ = nullptr;
  std::size_t left_ = 0;
};

/// The open voxels of a leaf, in the order of the leaf.
struct alignas(64) OpenLeaf {
  const FloatLeaf* leaf = nullptr;
  openvdb::Coord origin;
  bool decided = false;
  std::span<OpenVoxel> voxels;
  std::array<std::uint16_t, 8> first{};  ///< of the voxels at each x, as an index of `voxels`
  LeafBits open{};
  LeafBits free{};     ///< the open voxels that the guard allows to change
  LeafBits printed{};  ///< all voxels; those of the plain voxelization until they are decided

  /// Calls `visit(offset, voxel)` for every open voxel, in the order of the leaf.
  template <typename Visit>
  void forEachOpen(Visit visit) {
    OpenVoxel* voxel = voxels.data();
    forEachBit(open, [&](unsigned offset) { visit(offset, *voxel++); });
  }
};

/// The open voxels of a range of layers.
class OpenLeaves {
 public:
  struct Settings {
    openvdb::Vec3d pitch_mm;
    openvdb::Vec3d spread_mm;  ///< the blur of the process along each axis
    bool guarded = false;      ///< whether WallGuard decides which voxels are free
  };

  /// The maximum number of layers around a voxel that decide whether it is open and free.
  static int reachLayers(bool guarded);

  /// \param surface  d in mm; its band must hold k_D
  /// \param normals  the grid `N`, or null to use the gradient
  /// \param layers  whose leaves are held
  /// \param valid  the layers that can be read; others are outside the part
  OpenLeaves(const openvdb::FloatGrid& surface, const openvdb::Vec3SGrid* normals,
             const Settings& settings, const BlockOrder& order, ZRange layers, ZRange valid);

  /// The leaves of a block that have open voxels, in the order of the tree.
  using Block = std::span<OpenLeaf* const>;

  /// Finds blocks by their indices.
  class Finder {
   public:
    explicit Finder(const OpenLeaves& leaves)
        : blocks_(leaves.blocks_), numbers_(leaves.numbers_) {}
    /// Returns the block with this index, empty if there is none.
    Block operator()(const openvdb::Coord& index) {
      const openvdb::Int32 number = numbers_.getValue(index);
      return number < 0 ? Block() : blocks_[static_cast<std::size_t>(number)];
    }

   private:
    const std::vector<Block>& blocks_;
    openvdb::tree::ValueAccessor<const openvdb::Int32Tree, false> numbers_;
  };

  /// The printed voxels within `core`, by leaves.
  [[nodiscard]] std::vector<SolidLeaf> printed(ZRange core) const;

  /// Visits every leaf, all of them in parallel.
  template <typename Visit>
  void visitAtOnce(const Visit& visit) {
    tbb::parallel_for(std::size_t{0}, leaves_.size(), [&](std::size_t n) { visit(leaves_[n]); });
  }

  /// Visits every block within `range`, which consists of whole blocks, in the order of BlockOrder.
  /// Blocks of one colour, and layers of blocks of one parity, run in parallel: one layer at a time
  /// stays in the cache of a processor. `make_worker()` is called once for each thread and returns
  /// a function of a Block.
  template <typename MakeWorker>
  void visitInOrder(ZRange range, const MakeWorker& make_worker) {
    using Range = tbb::blocked_range<std::size_t>;
    tbb::enumerable_thread_specific<decltype(make_worker())> workers(make_worker);
    for (const std::vector<Layer>& layers : layers_) {
      tbb::parallel_for(Range(0, layers.size()), [&](const Range& some_layers) {
        for (std::size_t n = some_layers.begin(); n != some_layers.end(); ++n) {
          if (!range.contains(layers[n].bottom)) continue;
          for (const std::span<const Block> blocks : layers[n].blocks) {
            tbb::parallel_for(Range(0, blocks.size()), [&](const Range& some_blocks) {
              auto& visit = workers.local();
              for (std::size_t m = some_blocks.begin(); m != some_blocks.end(); ++m)
                visit(blocks[m]);
            });
          }
        }
      });
    }
  }

 private:
  struct Layer {
    int bottom;  ///< its lowest layer of voxels
    std::array<std::span<const Block>, BlockOrder::colours / 2> blocks;  ///< by colour
  };

  void sortIntoBlocks(const BlockOrder& order);

  tbb::enumerable_thread_specific<OpenVoxelStore> stores_;
  std::vector<OpenLeaf> leaves_;      ///< in the order of the tree
  std::vector<OpenLeaf*> in_blocks_;  ///< those with open voxels, by blocks
  std::vector<Block> blocks_;         ///< in the order of visits within each layer
  openvdb::Int32Tree numbers_{-1};  ///< indices of `blocks_`, by the indices of the blocks in space
  std::array<std::vector<Layer>, 2> layers_;  ///< by parity
};

}  // namespace vdbdither
