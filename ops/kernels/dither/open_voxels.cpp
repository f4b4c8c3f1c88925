#include "ops/kernels/dither/open_voxels.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "ops/kernels/dither/tone_curve.h"
#include "ops/kernels/dither/voxel_normals.h"
#include "ops/kernels/dither/wall_guard.h"
#include "ops/kernels/leaf/voxel_diameter.h"

namespace vdbdither {

using openvdb::Coord;

namespace {

/// Finds the open voxels of one leaf after the other.
class OpenVoxelFinder {
 public:
  OpenVoxelFinder(const openvdb::FloatGrid& surface, const openvdb::Vec3SGrid* normals,
                  const OpenLeaves::Settings& settings, const ToneCurve& tone, ZRange valid)
      : normals_(surface.tree(), settings.pitch_mm, normals ? &normals->tree() : nullptr, valid),
        settings_(settings),
        tone_(tone),
        guard_(surface.tree(), settings.pitch_mm, surface.background(), valid),
        valid_(valid) {}

  void operator()(OpenLeaf& open) {
    const FloatLeaf& leaf = *open.leaf;
    const std::uint8_t within = rowWithin(leaf.origin().z(), valid_);
    open.printed = insideBits(leaf, within);
    const auto bound =
        static_cast<float>(largestHalfVoxelDiameter(settings_.pitch_mm) * (1 + 1e-6));
    const LeafBits band = bandBits(leaf, bound, within);
    if (band == no_bits) return;
    normals_.visit(leaf, band);
    const LeafBits near = normals_.within(band, 1);
    open.voxels.reserve(countOf(near));
    for (unsigned x = 0; x < 8; ++x) {
      open.first[x] = static_cast<std::uint16_t>(open.voxels.size());
      forEachBit(near[x], [&](unsigned row) { add(open, 64 * x + row); });
    }
  }

 private:
  void add(OpenLeaf& open, unsigned offset) {
    const float d = open.leaf->buffer().data()[offset];
    const openvdb::Vec3s normal = normals_(offset);
    const double half_diameter_mm = halfVoxelDiameter(normal, settings_.pitch_mm);
    if (!(std::abs(double{d}) < half_diameter_mm)) return;

    const double spread_mm = (openvdb::Vec3d(normal) * settings_.spread_mm).length();
    open.voxels.push_back(
        {static_cast<float>(double{d} / spread_mm), tone_(d, half_diameter_mm, spread_mm), 0.0F});
    setBit(open.open, offset, true);
    setBit(open.free, offset,
           !settings_.guarded || guard_.allows(normals_.around(), open.leaf->origin(), offset,
                                               normal, d, half_diameter_mm));
  }

  VoxelNormals normals_;
  const OpenLeaves::Settings& settings_;
  const ToneCurve& tone_;
  WallGuard guard_;
  ZRange valid_;
};

}  // namespace

int OpenLeaves::reachLayers(bool guarded) { return guarded ? WallGuard::reachLayers(2) : 1; }

OpenLeaves::OpenLeaves(const openvdb::FloatGrid& surface, const openvdb::Vec3SGrid* normals,
                       const Settings& settings, const BlockOrder& order, ZRange layers,
                       ZRange valid) {
  const std::vector<const FloatLeaf*> held = leavesIn(surface.tree(), layers);
  leaves_.reserve(held.size());
  for (const FloatLeaf* leaf : held) {
    OpenLeaf& open = leaves_.emplace_back();
    open.leaf = leaf;
    open.origin = leaf->origin();
  }

  const ToneCurve tone;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves_.size()), [&](const auto& range) {
    OpenVoxelFinder find(surface, normals, settings, tone, valid);
    for (std::size_t n = range.begin(); n != range.end(); ++n) find(leaves_[n]);
  });
  sortIntoBlocks(order);
}

void OpenLeaves::sortIntoBlocks(const BlockOrder& order) {
  struct Ranked {
    std::array<int, 4> rank;  // the layer of blocks, the colour, the block
    OpenLeaf* leaf;
  };
  std::vector<Ranked> ranked;
  ranked.reserve(leaves_.size());
  for (OpenLeaf& leaf : leaves_) {
    if (leaf.voxels.empty()) continue;
    const Coord block = order.blockOf(leaf.origin);
    ranked.push_back({{block.z(), BlockOrder::colourOf(block), block.x(), block.y()}, &leaf});
  }
  // The leaves of a block keep the order of the tree.
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const Ranked& a, const Ranked& b) { return a.rank < b.rank; });

  in_blocks_.reserve(ranked.size());
  for (const Ranked& each : ranked) in_blocks_.push_back(each.leaf);
  openvdb::tree::ValueAccessor<openvdb::Int32Tree, false> numbers(numbers_);
  blocks_.reserve(ranked.size());
  for (std::size_t first = 0; first < ranked.size();) {
    const auto [z, colour, x, y] = ranked[first].rank;
    std::vector<Layer>& layers = layers_[static_cast<std::size_t>(z & 1)];
    if (first == 0 || ranked[first - 1].rank[0] != z) layers.push_back({z * order.edges().z(), {}});
    std::size_t next = first;
    while (next < ranked.size() && ranked[next].rank == ranked[first].rank) ++next;

    numbers.setValue({x, y, z}, static_cast<openvdb::Int32>(blocks_.size()));
    const Block& block = blocks_.emplace_back(&in_blocks_[first], next - first);
    std::span<const Block>& of_colour =
        layers.back().blocks[static_cast<std::size_t>(colour) % (BlockOrder::colours / 2)];
    of_colour = {of_colour.empty() ? &block : of_colour.data(), of_colour.size() + 1};
    first = next;
  }
}

std::vector<SolidLeaf> OpenLeaves::printed(ZRange core) const {
  std::vector<SolidLeaf> printed;
  for (const OpenLeaf& leaf : leaves_) {
    const std::uint8_t within = rowWithin(leaf.origin.z(), core);
    if (within == 0) continue;
    SolidLeaf& there = printed.emplace_back(SolidLeaf{leaf.origin, leaf.printed});
    for (std::uint64_t& word : there.inside) word &= everyRow(within);
  }
  return printed;
}

}  // namespace vdbdither
