#include "ops/kernels/dither/open_voxels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>

#include "ops/kernels/dither/tone_curve.h"
#include "ops/kernels/dither/voxel_normals.h"
#include "ops/kernels/dither/wall_guard.h"
#include "ops/kernels/leaf/floats.h"
#include "ops/kernels/leaf/voxel_diameter.h"
#include "vdbdither/model/instruction_set.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;

namespace {

/// Voxels near the surface in arrays, for computing four at a time.
struct NearVoxels {
  static constexpr std::size_t maximum = 512;
  template <typename T>
  using Values = std::array<T, maximum>;

  std::size_t count = 0;  ///< followed by zeros up to a multiple of four
  Values<std::uint16_t> offset;
  Values<float> d_mm;
  std::array<Values<float>, 3> normal;
  Values<double> half_diameter_mm;  ///< of open voxels, else zero
  Values<float> depth, tone;        ///< of open voxels

  void add(unsigned at, float d, const openvdb::Vec3s& along) {
    offset[count] = static_cast<std::uint16_t>(at);
    put(d, along);
    ++count;
  }
  void pad() {
    const std::size_t kept = count;
    for (; count % 4 != 0; ++count) put(0, openvdb::Vec3s(0.0F));
    count = kept;
  }

 private:
  void put(float d, const openvdb::Vec3s& along) {
    d_mm[count] = d;
    for (int axis = 0; axis < 3; ++axis)
      normal[static_cast<std::size_t>(axis)][count] = along[axis];
  }
};

[[gnu::always_inline]] inline void load(const float* from, Doubles& values) {
  values = __builtin_convertvector(loadFloats(from), Doubles);
}

[[gnu::always_inline]] inline void store(const Doubles& values, float* to) {
  storeFloats(to, __builtin_convertvector(values, Floats));
}

[[gnu::always_inline]] inline void takeRoot(Doubles& values) {
  for (std::size_t lane = 0; lane < 4; ++lane) values[lane] = std::sqrt(values[lane]);
}

/// Finds the open ones of `voxels`, and their depths and tones. Those that are not open are
/// computed with other lengths, which gives finite numbers.
[[gnu::always_inline]] inline void findOpen(NearVoxels& voxels, const Vec3d& pitch_mm,
                                            const Vec3d& all_spread_mm, const ToneCurve& curve) {
  for (std::size_t n = 0; n < voxels.count; n += 4) {
    Doubles d_mm;
    load(&voxels.d_mm[n], d_mm);
    Doubles steepest{};
    std::array<Doubles, 3> spread;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      Doubles normal;
      load(&voxels.normal[a][n], normal);
      const Doubles steep = (normal < 0.0 ? -normal : normal) / pitch_mm[axis];
      steepest = steep > steepest ? steep : steepest;
      spread[a] = normal * all_spread_mm[axis];
    }
    Doubles spread_mm = spread[0] * spread[0] + spread[1] * spread[1] + spread[2] * spread[2];
    takeRoot(spread_mm);
    const Doubles one = Doubles{} + 1.0;
    const Doubles half_mm = 0.5 / (steepest > 0.0 ? steepest : one);  // as halfVoxelDiameter
    const auto is_open = (steepest > 0.0) & (d_mm < half_mm) & (-d_mm < half_mm);
    const Doubles opened = is_open ? half_mm : Doubles{};
    std::memcpy(&voxels.half_diameter_mm[n], &opened, sizeof opened);
    spread_mm = is_open ? spread_mm : one;
    Doubles tone;
    curve(d_mm, is_open ? half_mm : one, spread_mm, tone);
    store(d_mm / spread_mm, &voxels.depth[n]);
    store(tone, &voxels.tone[n]);
  }
}

using FindOpen = void (*)(NearVoxels& voxels, const Vec3d& pitch_mm, const Vec3d& spread_mm,
                          const ToneCurve& curve);

void findOpenBaseline(NearVoxels& voxels, const Vec3d& pitch_mm, const Vec3d& spread_mm,
                      const ToneCurve& curve) {
  findOpen(voxels, pitch_mm, spread_mm, curve);
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] void findOpenAvx2(NearVoxels& voxels, const Vec3d& pitch_mm,
                                          const Vec3d& spread_mm, const ToneCurve& curve) {
  findOpen(voxels, pitch_mm, spread_mm, curve);
}
#endif

FindOpen findOpenFor([[maybe_unused]] InstructionSet instructions) {
#if defined(__x86_64__)
  if (instructions == InstructionSet::avx2) return &findOpenAvx2;
#endif
  return &findOpenBaseline;
}

/// Finds the open voxels of one leaf after the other.
class OpenVoxelFinder {
 public:
  OpenVoxelFinder(const openvdb::FloatGrid& surface, const openvdb::Vec3SGrid* normals,
                  const OpenLeaves::Settings& settings, const ToneCurve& tone, ZRange valid,
                  OpenVoxelStore& voxels)
      : normals_(surface.tree(), settings.pitch_mm, normals ? &normals->tree() : nullptr, valid),
        settings_(settings),
        tone_(tone),
        guard_(surface.tree(), settings.pitch_mm, surface.background(), valid),
        valid_(valid),
        store_(voxels),
        find_open_(findOpenFor(bestInstructionSet())) {}

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
    near_.count = 0;
    const float* d_mm = leaf.buffer().data();
    forEachBit(near, [&](unsigned offset) { near_.add(offset, d_mm[offset], normals_(offset)); });
    near_.pad();
    find_open_(near_, settings_.pitch_mm, settings_.spread_mm, tone_);
    take(open);
  }

 private:
  /// Takes over the open ones of the voxels that are near.
  void take(OpenLeaf& open) {
    OpenVoxel* const voxels = store_.reserve(near_.count);
    std::size_t count = 0;
    std::array<std::uint16_t, 8> at_x{};
    for (std::size_t n = 0; n < near_.count; ++n) {
      const double half_diameter_mm = near_.half_diameter_mm[n];
      if (half_diameter_mm == 0) continue;
      voxels[count++] = {near_.depth[n], near_.tone[n], 0.0F};
      const unsigned offset = near_.offset[n];
      ++at_x[offset / 64];
      setBit(open.open, offset, true);
      setBit(open.free, offset,
             !settings_.guarded ||
                 guard_.allows(normals_.around(), open.origin, offset,
                               {near_.normal[0][n], near_.normal[1][n], near_.normal[2][n]},
                               near_.d_mm[n], half_diameter_mm));
    }
    open.voxels = store_.keep(count);
    std::exclusive_scan(at_x.begin(), at_x.end(), open.first.begin(), std::uint16_t{0});
  }

  VoxelNormals normals_;
  const OpenLeaves::Settings& settings_;
  const ToneCurve& tone_;
  WallGuard guard_;
  ZRange valid_;
  OpenVoxelStore& store_;
  FindOpen find_open_;
  NearVoxels near_;
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
    OpenVoxelFinder find(surface, normals, settings, tone, valid, stores_.local());
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
