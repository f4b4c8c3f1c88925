// A Euclidean distance transform by axes (T. Saito, J. Toriwaki, "New algorithms for Euclidean
// distance transformation of an n-dimensional digitized picture", Pattern Recognition 27, 1994),
// each pass limited to the maximum depth of the bands and to leaf-sized blocks that hold voxels:
// along z from the bits of the leaves, then y, then x. A pass goes outwards from each plane of a
// block and ends when no further step can change the result: along x, when every voxel of the plane
// lies in the outermost band.

#include "ops/kernels/printing/depth_bands.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/leaf/true_bits.h"

namespace vdbdither {

namespace {

using openvdb::BoolTree;
using openvdb::Coord;
using Int32Leaf = openvdb::Int32Tree::LeafNodeType;

constexpr int edge = leaf_layers;
constexpr std::ptrdiff_t plane = 64;
static_assert(plane == edge * edge);
constexpr int volume = edge * edge * edge;
constexpr float infinite = std::numeric_limits<float>::infinity();

bool all(const LeafBits& bits) {
  return std::all_of(bits.begin(), bits.end(), [](std::uint64_t word) { return ~word == 0; });
}

/// The squared distances of a block's voxels; they are stored only if they differ.
struct Block {
  enum class State { unknown, zero, beyond_reach, mixed };
  State state = State::unknown;
  std::array<float, volume> squares;  ///< planes along the axis of the next pass
};

/// The squared distances of a plane, while they are reduced.
using Plane = std::array<float, plane>;

/// to[i] = min(to[i], from[i] + added).
void lower(Plane& to, const float* from, float added) {
  Plane lowered;
  for (std::size_t i = 0; i < to.size(); ++i) lowered[i] = std::min(to[i], from[i] + added);
  to = lowered;
}
void lower(Plane& to, float added) {
  for (float& square : to) square = std::min(square, added);
}

float maximumOf(const Plane& squares) {
  Plane maximum = squares;
  // Compares halves, so that lanes do not depend on each other.
  for (std::size_t half = maximum.size() / 2; half >= 4; half /= 2) {
    for (std::size_t i = 0; i < half; ++i) maximum[i] = std::max(maximum[i], maximum[i + half]);
  }
  return std::max(std::max(maximum[0], maximum[1]), std::max(maximum[2], maximum[3]));
}

int leafOrigin(int index) { return index & ~(edge - 1); }

/// Returns the number of steps of `pitch_mm` within `depth_mm`, with a small tolerance, so that a
/// depth of n steps holds n.
int stepsWithin(double depth_mm, double pitch_mm) {
  return static_cast<int>(depth_mm * (1 + 1e-6) / pitch_mm);
}

/// The result for one block.
struct Output {
  Coord origin;
  std::unique_ptr<Int32Leaf> leaf;  ///< null for a tile
  std::int32_t value = 0;
};

/// Transforms rows of blocks along x.
class StripTransform {
 public:
  StripTransform(const openvdb::BoolGrid& solid, const openvdb::Vec3d& pitch_mm,
                 const openvdb::CoordBBox& region, ZRange valid, std::span<const DepthBand> bands,
                 std::int32_t beneath)
      : accessor_(solid.tree()),
        valid_(valid),
        bands_(bands),
        beneath_(beneath),
        x_begin_(leafOrigin(region.min().x())),
        x_blocks_((region.max().x() - x_begin_) / edge + 1) {
    const double depth_mm = bands.empty() ? 0 : bands.back().to_mm;
    for (int axis = 0; axis < 3; ++axis) {
      for (int i = 0; i <= stepsWithin(depth_mm, pitch_mm[axis]); ++i) {
        const double distance_mm = i * pitch_mm[axis];
        squares_[axis].push_back(static_cast<float>(distance_mm * distance_mm));
      }
    }
    for (const DepthBand& band : bands) {
      const double limit_mm = band.to_mm * (1 + 1e-6);
      limits_.push_back(static_cast<float>(limit_mm * limit_mm));
    }
    blocks_.resize(x_blocks_ + 2 * static_cast<std::size_t>(blocksWithinReach(0)));
    rows_.resize(2 * static_cast<std::size_t>(blocksWithinReach(1)) + 1);
    along_y_.resize(rows_.size());
    for (Row& row : rows_) row.blocks.resize(blocks_.size());
  }

  /// Adds the blocks at (·, y, z) that hold voxels to `out`. Fastest if y rises at the same z.
  void run(int y, int z, std::vector<Output>& out) {
    using Branch = BoolTree::RootNodeType::ChildNodeType::ChildNodeType;
    constexpr int branch_edge = static_cast<int>(Branch::DIM);
    turnTo(y, z);
    for (int index = 0; index < x_blocks_;) {
      const Coord origin(x_begin_ + index * edge, y, z);
      if (!accessor_.probeConstNode<Branch>(origin) && !accessor_.isValueOn(origin)) {
        index += (branch_edge - (origin.x() & (branch_edge - 1))) / edge;
        continue;
      }
      if (const LeafBits bits = bitsAt(origin); bits != no_bits) {
        out.push_back(makeOutput(index, origin, bits));
      }
      ++index;
    }
  }

 private:
  [[nodiscard]] int reach(int axis) const { return static_cast<int>(squares_[axis].size()) - 1; }
  [[nodiscard]] int blocksWithinReach(int axis) const { return (reach(axis) + edge - 1) / edge; }

  /// The blocks at (·, y, z) after the pass along z, made on demand.
  struct Row {
    int y = 0;
    std::vector<Block> blocks;
  };

  /// Returns the row of `y`, from a ring of rows.
  [[nodiscard]] Row& row(int y) {
    const int count = static_cast<int>(rows_.size());
    return rows_[((y / edge) % count + count) % count];
  }

  void turnTo(int y, int z) {
    for (Block& block : blocks_) block.state = Block::State::unknown;
    const int margin = blocksWithinReach(1);
    for (int i = -margin; i <= margin; ++i) {
      Row& kept = row(y + i * edge);
      if (kept.y == y + i * edge && z == z_) continue;
      kept.y = y + i * edge;
      for (Block& block : kept.blocks) block.state = Block::State::unknown;
    }
    z_ = z;
  }

  [[nodiscard]] LeafBits bitsAt(const Coord& origin) const {
    return trueBits(accessor_, origin, valid_);
  }

  /// Returns the number of consecutive solid voxels above (or below) each column of the block, up
  /// to the reach.
  [[nodiscard]] std::array<int, plane> solidBeyond(const Coord& origin, bool above) const {
    std::array<int, plane> count{};
    std::array<bool, plane> open;
    open.fill(true);
    for (int depth = 0; depth < reach(2); depth += edge) {
      const LeafBits bits = bitsAt(origin.offsetBy(0, 0, above ? edge + depth : -edge - depth));
      if (all(bits)) {
        for (int column = 0; column < plane; ++column) count[column] += open[column] ? edge : 0;
        continue;
      }
      if (bits == no_bits) break;
      bool any_open = false;
      for (int column = 0; column < plane; ++column) {
        if (!open[column]) continue;
        const auto byte =
            static_cast<std::uint8_t>(bits[column / edge] >> (edge * (column % edge)));
        count[column] += above ? std::countr_one(byte) : std::countl_one(byte);
        open[column] = byte == 255;
        any_open = any_open || open[column];
      }
      if (!any_open) break;
    }
    return count;
  }

  /// The pass along z: the distance to the nearest empty voxel of the column.
  const Block& passZ(int index, const Coord& origin) {
    Block& block = row(origin.y()).blocks[index + blocksWithinReach(0)];
    if (block.state != Block::State::unknown) return block;
    const LeafBits bits = bitsAt(origin);
    if (bits == no_bits) {
      block.state = Block::State::zero;
      return block;
    }
    const std::array<int, plane> below = solidBeyond(origin, false);
    const std::array<int, plane> above = solidBeyond(origin, true);
    block.state = Block::State::beyond_reach;
    const auto far = [&](int count) { return count >= reach(2); };
    if (all(bits) && std::all_of(below.begin(), below.end(), far) &&
        std::all_of(above.begin(), above.end(), far))
      return block;
    for (int column = 0; column < plane; ++column) {
      const int x = column / edge;
      const int y = column % edge;
      const std::uint64_t byte = bits[x] >> (edge * y);
      std::array<int, edge> steps;
      int span = below[column];
      for (int z = 0; z < edge; ++z) steps[z] = span = byte >> z & 1 ? span + 1 : 0;
      span = above[column];
      for (int z = edge - 1; z >= 0; --z) {
        span = byte >> z & 1 ? span + 1 : 0;
        steps[z] = std::min(steps[z], span);
        const bool within = steps[z] <= reach(2);
        block.squares[y * plane + x * edge + z] = within ? squares_[2][steps[z]] : infinite;
        if (within) block.state = Block::State::mixed;
      }
    }
    return block;
  }

  /// Returns the minimum over the planes of a row of blocks around plane `at`, up to the reach, or
  /// until no value above `enough` can be reduced.
  template <typename BlockAt>
  Plane minimumAround(int at, int axis, float enough, const BlockAt& block_at) const {
    Plane minimum;
    minimum.fill(infinite);
    const std::vector<float>& added = squares_[axis];
    const auto take = [&](int from, float square) {
      const Block& source = block_at(from / edge);
      if (source.state == Block::State::zero) lower(minimum, square);
      if (source.state == Block::State::mixed)
        lower(minimum, source.squares.data() + from % edge * plane, square);
    };
    take(at, added[0]);
    for (int step = 1; step <= reach(axis); ++step) {
      // Tested at every step at first, at every eighth later.
      if (step <= 4 || step % edge == 0) {
        const float maximum = maximumOf(minimum);
        if (maximum <= std::max(enough, added[step])) break;
      }
      take(at - step, added[step]);
      take(at + step, added[step]);
    }
    return minimum;
  }

  /// The pass along y, from the columns in front and behind. Made once per block.
  const Block& passY(int index, const Coord& origin) {
    Block& block = blocks_[index + blocksWithinReach(0)];
    if (block.state != Block::State::unknown) return block;
    const int margin = blocksWithinReach(1);
    bool all_beyond = true;
    for (int i = 0; i <= 2 * margin; ++i) {
      along_y_[i] = &passZ(index, origin.offsetBy(0, (i - margin) * edge, 0));
      all_beyond = all_beyond && along_y_[i]->state == Block::State::beyond_reach;
    }
    if (along_y_[margin]->state == Block::State::zero) {
      block.state = Block::State::zero;
      return block;
    }
    block.state = Block::State::beyond_reach;
    for (int y = 0; y < edge && !all_beyond; ++y) {
      const Plane minimum = minimumAround(y + margin * edge, 1, 0,
                                          [&](int i) -> const Block& { return *along_y_[i]; });
      for (int x = 0; x < edge; ++x) {
        for (int z = 0; z < edge; ++z) {
          const float square = minimum[x * edge + z];
          if (square <= limits_.back()) block.state = Block::State::mixed;
          block.squares[(x * edge + y) * edge + z] = square;
        }
      }
    }
    return block;
  }

  /// The pass along x, and the bands.
  Output makeOutput(int index, const Coord& origin, const LeafBits& bits) {
    const int margin = blocksWithinReach(0);
    bool all_beyond = true;
    for (int i = -margin; i <= margin; ++i) {
      const Block& block = passY(index + i, origin.offsetBy(i * edge, 0, 0));
      all_beyond = all_beyond && block.state == Block::State::beyond_reach;
    }
    if (all_beyond && all(bits)) return {origin, nullptr, beneath_};
    std::array<float, volume> squares;
    squares.fill(infinite);
    for (int x = 0; x < edge && !all_beyond; ++x) {
      const Plane minimum =
          minimumAround(x + margin * edge, 0, limits_.front(),
                        [&](int i) -> const Block& { return blocks_[index + i]; });
      std::copy(minimum.begin(), minimum.end(), squares.begin() + x * plane);
    }
    std::array<std::int32_t, volume> values{};
    for (int i = 0; i < volume; ++i) {
      if (bits[i / plane] >> (i % plane) & 1) values[i] = valueAt(squares[i]);
    }
    const auto same = [&](std::int32_t value) { return value == values[0]; };
    if (all(bits) && std::all_of(values.begin(), values.end(), same)) {
      return {origin, nullptr, values[0]};
    }
    Output output{origin, std::make_unique<Int32Leaf>(origin, 0, false), 0};
    for (int x = 0; x < edge; ++x) {
      output.leaf->getValueMask().getWord<openvdb::Index64>(x) = bits[x];
    }
    std::copy(values.begin(), values.end(), output.leaf->buffer().data());
    return output;
  }

  [[nodiscard]] std::int32_t valueAt(float square) const {
    for (std::size_t i = 0; i < limits_.size(); ++i) {
      if (square <= limits_[i]) return bands_[i].value;
    }
    return beneath_;
  }

  openvdb::tree::ValueAccessor<const BoolTree, false> accessor_;
  ZRange valid_;
  std::span<const DepthBand> bands_;
  std::int32_t beneath_;
  int x_begin_;
  int x_blocks_;
  std::array<std::vector<float>, 3> squares_;  ///< per axis, (i · pitch)² within reach
  std::vector<float> limits_;                  ///< per band, squared
  std::vector<Block> blocks_;          ///< the row of blocks after the pass along y, with margins
  std::vector<Row> rows_;              ///< the rows around it after the pass along z
  std::vector<const Block*> along_y_;  ///< the blocks of these rows that one block needs
  int z_ = 0;
};

}  // namespace

int depthReach(std::span<const DepthBand> bands, double layer_mm) {
  return bands.empty() ? 0 : stepsWithin(bands.back().to_mm, layer_mm);
}

openvdb::Int32Grid::Ptr valueByDepth(const openvdb::BoolGrid& solid, const openvdb::Vec3d& pitch_mm,
                                     const openvdb::CoordBBox& region, ZRange core, ZRange valid,
                                     std::span<const DepthBand> bands, std::int32_t beneath) {
  auto result = openvdb::Int32Grid::create(0);
  result->setTransform(solid.transform().copy());
  if (region.empty() || core.empty()) return result;
  const int y_begin = leafOrigin(region.min().y());
  const int strips = (region.max().y() - y_begin) / edge + 1;
  const ZRange layers = alignedToLeaves(core);
  // A piece of work is some strips of one layer of leaves: enough to share most of their margins,
  // few enough to keep all threads busy.
  constexpr int strips_per_piece = 16;
  const int pieces_per_layer = (strips + strips_per_piece - 1) / strips_per_piece;
  const int pieces = pieces_per_layer * (layers.size() / edge);
  std::vector<std::vector<Output>> outputs(pieces);
  tbb::parallel_for(tbb::blocked_range<int>(0, pieces), [&](const tbb::blocked_range<int>& range) {
    StripTransform transform(solid, pitch_mm, region, valid, bands, beneath);
    for (int piece = range.begin(); piece < range.end(); ++piece) {
      const int z = layers.begin + piece / pieces_per_layer * edge;
      const int first = piece % pieces_per_layer * strips_per_piece;
      for (int strip = first; strip < std::min(first + strips_per_piece, strips); ++strip)
        transform.run(y_begin + strip * edge, z, outputs[piece]);
    }
  });
  for (std::vector<Output>& strip : outputs) {
    for (Output& output : strip) {
      if (output.leaf) {
        result->tree().addLeaf(output.leaf.release());
      } else {
        result->tree().addTile(1, output.origin, output.value, true);
      }
    }
  }
  return result;
}

}  // namespace vdbdither
