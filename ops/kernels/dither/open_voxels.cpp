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
    forEachBit(near, [&](unsigned offset) { add(open, offset); });
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
           !settings_.guarded ||
               guard_.allows(normals_.around(), open.leaf->origin(), offset, normal, d));
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
  for (const FloatLeaf* leaf : leavesIn(surface.tree(), layers))
    leaves_.push_back({leaf, {}, {}, {}, false, {}});
  sortIntoBlocks(order);

  const ToneCurve tone;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves_.size()), [&](const auto& range) {
    OpenVoxelFinder find(surface, normals, settings, tone, valid);
    for (std::size_t n = range.begin(); n != range.end(); ++n) find(leaves_[n]);
  });
}

void OpenLeaves::sortIntoBlocks(const BlockOrder& order) {
  struct Ranked {
    std::array<int, 4> rank;  // the layer of blocks, the colour, the block
    std::uint32_t leaf;
  };
  std::vector<Ranked> ranked;
  ranked.reserve(leaves_.size());
  openvdb::tree::ValueAccessor<openvdb::Int32Tree, false> numbers(numbers_);
  for (std::uint32_t n = 0; n < leaves_.size(); ++n) {
    const Coord origin = leaves_[n].leaf->origin();
    const Coord block = order.blockOf(origin);
    ranked.push_back({{block.z(), BlockOrder::colourOf(block), block.x(), block.y()}, n});
    numbers.setValue(origin >> leaf_shift, static_cast<openvdb::Int32>(n));
  }
  // The leaves of a block keep the order of the tree.
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const Ranked& a, const Ranked& b) { return a.rank < b.rank; });

  in_blocks_.reserve(ranked.size());
  for (const Ranked& each : ranked) in_blocks_.push_back(&leaves_[each.leaf]);
  for (std::size_t first = 0; first < ranked.size();) {
    const auto [z, colour, x, y] = ranked[first].rank;
    std::vector<Layer>& layers = layers_[static_cast<std::size_t>(z & 1)];
    if (first == 0 || ranked[first - 1].rank[0] != z) layers.push_back({z * order.edges().z(), {}});
    std::size_t next = first;
    while (next < ranked.size() && ranked[next].rank == ranked[first].rank) ++next;
    layers.back().blocks[static_cast<std::size_t>(colour) % (BlockOrder::colours / 2)].emplace_back(
        &in_blocks_[first], next - first);
    first = next;
  }
}

std::vector<SolidLeaf> OpenLeaves::printed(ZRange core) const {
  std::vector<SolidLeaf> printed;
  for (const OpenLeaf& leaf : leaves_) {
    const std::uint8_t within = rowWithin(leaf.leaf->origin().z(), core);
    if (within == 0) continue;
    SolidLeaf& there = printed.emplace_back(SolidLeaf{leaf.leaf->origin(), leaf.printed});
    for (std::uint64_t& word : there.inside) word &= everyRow(within);
  }
  return printed;
}

OpenSurroundings::OpenSurroundings(const HeightKernel& kernel, const BlockOrder& order)
    : kernel_(kernel),
      order_(order),
      reach_(kernel.reach()),
      edges_(order.edges() + reach_ + reach_),
      stride_(static_cast<std::size_t>(edges_.z()) + 3),  // four values are read at a time
      present_(static_cast<std::size_t>(edges_.x() * edges_.y())),
      depths_(present_.size() * stride_),
      errors_(present_.size() * stride_) {
  static_assert(3 * HeightKernel::maximum_reach <= 64, "a column fits into a word");
}

void OpenSurroundings::visit(const OpenLeaf& leaf, OpenLeaves::Finder& leaves) {
  for (std::size_t column = 0; column < present_.size(); ++column) {
    if (present_[column] != 0) std::fill_n(&errors_[column * stride_], stride_, 0.0F);
    present_[column] = 0;
  }
  lowest_ = order_.cornerOf(leaf.leaf->origin()) - reach_;
  const Coord first = lowest_ & ~(leaf_layers - 1);
  for (int x = first.x(); x < lowest_.x() + edges_.x(); x += leaf_layers) {
    for (int y = first.y(); y < lowest_.y() + edges_.y(); y += leaf_layers) {
      for (int z = first.z(); z < lowest_.z() + edges_.z(); z += leaf_layers) {
        const Coord origin(x, y, z);
        const OpenLeaf* there = leaves(origin);
        if (there && there->decided && !there->voxels.empty()) read(*there, origin - lowest_);
      }
    }
  }
}

void OpenSurroundings::read(const OpenLeaf& leaf, const Coord& from) {
  // A row along z of the leaf, cut at the ends of the columns here.
  const int low = std::max(0, -from.z());
  const int high = std::min(leaf_layers, edges_.z() - from.z());
  const unsigned kept = (1U << high) - (1U << low);
  const OpenVoxel* next = leaf.voxels.data();
  for (int x = 0; x < leaf_layers; ++x) {
    const std::uint64_t word = leaf.open[static_cast<std::size_t>(x)];
    if (word == 0) continue;
    const OpenVoxel* const of_word = next;
    next += std::popcount(word);
    const int to_x = from.x() + x;
    if (to_x < 0 || to_x >= edges_.x()) continue;
    const OpenVoxel* voxel = of_word;
    for (int y = 0; y < leaf_layers; ++y) {
      unsigned row = static_cast<unsigned>(word >> (8 * y)) & 0xffU;
      if (row == 0) continue;
      const OpenVoxel* const of_row = voxel;
      voxel += std::popcount(row);
      const int to_y = from.y() + y;
      if (to_y < 0 || to_y >= edges_.y()) continue;
      const OpenVoxel* copied = of_row + std::popcount(row & ((1U << low) - 1));
      row &= kept;
      if (row == 0) continue;
      const std::size_t column = columnOf(to_x, to_y);
      present_[column] |=
          from.z() >= 0 ? std::uint64_t{row} << from.z() : std::uint64_t{row} >> -from.z();
      for (; row != 0; row &= row - 1, ++copied) {
        const int to_z = from.z() + std::countr_zero(row);
        const std::size_t to = column * stride_ + static_cast<std::size_t>(to_z);
        depths_[to] = copied->depth;
        errors_[to] = copied->error;
      }
    }
  }
}

void OpenSurroundings::set(const Coord& ijk, const OpenVoxel& voxel) {
  const Coord at = ijk - lowest_;
  const std::size_t column = columnOf(at.x(), at.y());
  present_[column] |= std::uint64_t{1} << at.z();
  const std::size_t to = column * stride_ + static_cast<std::size_t>(at.z());
  depths_[to] = voxel.depth;
  errors_[to] = voxel.error;
}

float OpenSurroundings::sum(const Coord& ijk, float depth) const {
  const Coord at = ijk - lowest_;
  const std::vector<HeightKernel::Hill>& hills = kernel_.hills();
  if (hills.size() == 1) return sumOf(at, depth, hills.front());
  return sumOf(at, depth,
               [narrow = hills[0], wide = hills[1]](Floats x) { return narrow(x) + wide(x); });
}

template <typename Weigh>
float OpenSurroundings::sumOf(const Coord& at, float depth, Weigh weigh) const {
  Floats sum{};
  for (const HeightKernel::Column& column : kernel_.columns()) {
    const std::size_t there = columnOf(at.x() + column.x, at.y() + column.y);
    const int bottom = at.z() - column.z;
    const std::uint64_t window = (std::uint64_t{2} << (2 * column.z)) - 1;
    if ((present_[there] >> bottom & window) == 0) continue;
    const std::size_t first = there * stride_ + static_cast<std::size_t>(bottom);
    const float* depths = &depths_[first];
    const float* errors = &errors_[first];
    for (const Floats& along2 : kernel_.along2(column.z)) {
      const Floats deeper = depth - loadFloats(depths);
      sum += loadFloats(errors) * weigh(column.across2 + along2 - deeper * deeper);
      depths += 4;
      errors += 4;
    }
  }
  return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

}  // namespace vdbdither
