#include "ops/kernels/leaf/bit_layers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <tbb/parallel_for.h>

#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/true_bits.h"

namespace vdbdither {

using openvdb::Coord;

namespace {

constexpr int word_bits = 64;

/// Reads tiles and leaves of a grid of bits: active and true voxels count.
struct TrueVoxels {
  using Tree = openvdb::BoolTree;

  [[nodiscard]] static bool tile(bool value, bool active) { return value && active; }
  [[nodiscard]] static LeafBits leaf(const Tree::LeafNodeType& leaf) { return trueBits(leaf); }
};

struct ScalarVoxels {
  using Tree = openvdb::FloatTree;
  Inside inside;
  float level;

  [[nodiscard]] bool tile(float value, bool /*active*/) const {
    return inside == Inside::below ? value < level : value > level;
  }
  [[nodiscard]] LeafBits leaf(const FloatLeaf& leaf) const {
    const float* values = leaf.buffer().data();
    // Values above the level are not below the next float after it.
    const bool above = inside == Inside::above;
    const float limit =
        above ? std::nextafter(level, std::numeric_limits<float>::infinity()) : level;
    LeafBits bits;
    for (unsigned x = 0; x < bits.size(); ++x) {
      const std::uint64_t below = wordBelow(values + 64 * x, limit);
      bits[x] = above ? ~below : below;
    }
    return bits;
  }
};

/// Transposes an 8 × 8 matrix of bits whose rows are the bytes of `m` (Warren, "Hacker's Delight").
constexpr std::uint64_t transposed(std::uint64_t m) {
  std::uint64_t t = (m ^ (m >> 7)) & 0x00AA00AA00AA00AAU;
  m ^= t ^ (t << 7);
  t = (m ^ (m >> 14)) & 0x0000CCCC0000CCCCU;
  m ^= t ^ (t << 14);
  t = (m ^ (m >> 28)) & 0x00000000F0F0F0F0U;
  return m ^ t ^ (t << 28);
}

/// The eight rows along x of a leaf at one y: byte z holds the row at z.
std::uint64_t rowsAlongX(const LeafBits& bits, unsigned y) {
  std::uint64_t matrix = 0;
  for (unsigned x = 0; x < bits.size(); ++x) matrix |= (bits[x] >> (8 * y) & 0xFF) << (8 * x);
  return transposed(matrix);
}

template <typename Voxels>
std::vector<BitLayer> layersOf(const openvdb::Grid<typename Voxels::Tree>& grid,
                               const BitLayout& layout, ZRange layers, const Voxels& voxels) {
  std::vector<BitLayer> made(static_cast<std::size_t>(std::max(0, layers.size())),
                             layout.emptyLayer());
  const openvdb::CoordBBox& box = layout.box();
  if (made.empty() || box.empty()) return made;
  const int first_bit = box.min().x() - layout.xBegin();
  const int last_bit = box.max().x() - layout.xBegin();
  const int first_leaf_y = box.min().y() & ~(leaf_layers - 1);
  const int last_leaf_y = box.max().y() & ~(leaf_layers - 1);
  const ZRange aligned = alignedToLeaves(layers);
  // Leaves at one y fill whole rows, so that no two threads write to the same word.
  tbb::parallel_for(0, (last_leaf_y - first_leaf_y) / leaf_layers + 1, [&](int strip) {
    const auto accessor = grid.getConstAccessor();
    const int y = first_leaf_y + strip * leaf_layers;
    const int y_end = std::min(y + leaf_layers, box.max().y() + 1);
    for (int z = aligned.begin; z < aligned.end; z += leaf_layers) {
      const ZRange here = intersection({z, z + leaf_layers}, layers);
      const auto set = [&](int byte, unsigned local_y, std::uint64_t rows_by_z) {
        const int row = y + static_cast<int>(local_y) - layout.yBegin();
        const std::size_t word = layout.row(row) + static_cast<std::size_t>(byte / 8);
        for (int k = here.begin; k < here.end; ++k) {
          made[static_cast<std::size_t>(k - layers.begin)][word] |=
              (rows_by_z >> (8 * (k - z)) & 0xFF) << (8 * (byte % 8));
        }
      };
      for (int byte = first_bit / 8; byte <= last_bit / 8; ++byte) {
        const Coord origin(layout.xBegin() + 8 * byte, y, z);
        if (const auto* leaf = accessor.probeConstLeaf(origin)) {
          const LeafBits bits = voxels.leaf(*leaf);
          for (int at = std::max(y, box.min().y()); at < y_end; ++at) {
            const auto local_y = static_cast<unsigned>(at - y);
            set(byte, local_y, rowsAlongX(bits, local_y));
          }
          continue;
        }
        typename Voxels::Tree::ValueType value;
        const bool active = accessor.probeValue(origin, value);
        if (!voxels.tile(value, active)) continue;
        for (int at = std::max(y, box.min().y()); at < y_end; ++at)
          set(byte, static_cast<unsigned>(at - y), ~std::uint64_t{0});
      }
    }
    // Clears the bits of these words that lie beyond the box.
    for (int at = std::max(y, box.min().y()); at < y_end; ++at) {
      const std::size_t begin = layout.row(at - layout.yBegin());
      for (BitLayer& layer : made) {
        layer[begin + static_cast<std::size_t>(first_bit / word_bits)] &=
            ~std::uint64_t{0} << (first_bit % word_bits);
        layer[begin + static_cast<std::size_t>(last_bit / word_bits)] &=
            ~std::uint64_t{0} >> (word_bits - 1 - last_bit % word_bits);
      }
    }
  });
  return made;
}

}  // namespace

BitLayout::BitLayout(const openvdb::CoordBBox& box) : box_(box) {
  x_begin_ = (box.min().x() - 1) & ~(leaf_layers - 1);
  y_begin_ = box.min().y() - 1;
  words_ = box.empty() ? 0 : (box.max().x() + 1 - x_begin_) / word_bits + 1;
  rows_ = box.empty() ? 0 : box.dim().y() + 2;
}

std::vector<BitLayer> bitLayers(const openvdb::BoolGrid& grid, const BitLayout& layout,
                                ZRange layers) {
  return layersOf(grid, layout, layers, TrueVoxels{});
}

std::vector<BitLayer> bitLayers(const openvdb::FloatGrid& grid, const BitLayout& layout,
                                ZRange layers, Inside inside, float level) {
  return layersOf(grid, layout, layers, ScalarVoxels{inside, level});
}

}  // namespace vdbdither
