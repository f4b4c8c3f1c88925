#include "ops/kernels/dither/open_surroundings.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

#include "ops/kernels/leaf/floats.h"

namespace vdbdither {

using openvdb::Coord;

namespace {

constexpr std::size_t no_column = std::numeric_limits<std::size_t>::max();

/// Values are read by eight.
constexpr std::size_t padding = 7;

template <typename Lanes>
[[gnu::always_inline]] inline void load(const float* from, Lanes& values) {
  std::memcpy(&values, from, sizeof values);
}

}  // namespace

/// The sum, compiled for each instruction set and number of hills.
struct OpenSurroundings::Loops {
  /// Lists the groups that hold voxels, without branches: they would often be foretold wrongly.
  template <unsigned lanes>
  [[gnu::always_inline]] static std::size_t listGroups(OpenSurroundings& around, unsigned z) {
    constexpr std::uint64_t all = (std::uint64_t{1} << lanes) - 1;
    Group* const groups = around.groups_.data();
    std::size_t count = 0;
    for (std::size_t m = 0; m < around.near_count_; ++m) {
      const Near& near = around.near_[m];
      const unsigned bottom = z - near.half;
      std::uint64_t bits = *near.present >> bottom & ((std::uint64_t{2} << (2 * near.half)) - 1);
      for (unsigned n = 0; n <= 2 * near.half; n += lanes) {
        groups[count] = {near.first + bottom + n, near.apart2 + n};
        count += static_cast<std::size_t>((bits & all) != 0);
        bits >>= lanes;
      }
    }
    return count;
  }

  template <typename Lanes, std::size_t hill_count>
  [[gnu::always_inline]] static float sumOf(OpenSurroundings& around, unsigned z, float depth) {
    constexpr unsigned lanes = sizeof(Lanes) / sizeof(float);
    const HeightKernel& kernel = around.kernel_;
    const std::size_t count = listGroups<lanes>(around, z);
    Floats sum{};
    for (std::size_t n = 0; n < count; ++n) {
      const Group& group = around.groups_[n];
      Lanes apart2, depths, errors, w;
      load(&kernel.apart2()[group.apart2], apart2);
      load(&around.depths_[group.voxels], depths);
      load(&around.errors_[group.voxels], errors);
      const Lanes deeper = depth - depths;
      const Lanes x = apart2 - deeper * deeper;
      kernel.hills()[0].weigh(x, w);
      if constexpr (hill_count == 2) {
        Lanes wide;
        kernel.hills()[1].weigh(x, wide);
        w += wide;
      }
      const Lanes terms = errors * w;
      if constexpr (lanes == 4) {
        sum += terms;
      } else {
        sum += __builtin_shufflevector(terms, terms, 0, 1, 2, 3);
        sum += __builtin_shufflevector(terms, terms, 4, 5, 6, 7);
      }
    }
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
  }

  template <std::size_t hill_count>
  static float sumBaseline(OpenSurroundings& around, unsigned z, float depth) {
    return sumOf<Floats, hill_count>(around, z, depth);
  }

#if defined(__x86_64__)
  template <std::size_t hill_count>
  [[gnu::target("avx2")]] static float sumAvx2(OpenSurroundings& around, unsigned z, float depth) {
    return sumOf<EightFloats, hill_count>(around, z, depth);
  }
#endif
};

OpenSurroundings::OpenSurroundings(const HeightKernel& kernel, const BlockOrder& order,
                                   [[maybe_unused]] InstructionSet instructions)
    : kernel_(kernel),
      order_(order),
      sum_(kernel.hills().size() == 1 ? &Loops::sumBaseline<1> : &Loops::sumBaseline<2>),
      reach_(kernel.reach()),
      edges_(order.edges() + reach_ + reach_),
      stride_(static_cast<std::size_t>(edges_.z()) + padding),
      present_(static_cast<std::size_t>(edges_.x() * edges_.y())),
      depths_(present_.size() * stride_),
      errors_(present_.size() * stride_),
      own_column_(no_column),
      near_(kernel.columns().size() + 1),
      groups_(kernel.apart2().size() / 4 + 1) {
  static_assert(3 * HeightKernel::maximum_reach <= 64, "a column fits into a word");
#if defined(__x86_64__)
  if (instructions == InstructionSet::avx2)
    sum_ = kernel.hills().size() == 1 ? &Loops::sumAvx2<1> : &Loops::sumAvx2<2>;
#endif
}

void OpenSurroundings::clear() {
  for (std::size_t column = 0; column < present_.size(); ++column) {
    if (present_[column] == 0) continue;
    std::fill_n(&errors_[column * stride_], stride_, 0.0F);
    present_[column] = 0;
  }
}

void OpenSurroundings::visit(OpenLeaves::Block block, OpenLeaves::Finder& find) {
  clear();
  own_column_ = no_column;
  const Coord origin = block.front()->origin;
  lowest_ = order_.cornerOf(origin) - reach_;
  const Coord index = order_.blockOf(origin);
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        for (const OpenLeaf* leaf : find(index.offsetBy(x, y, z))) {
          if (leaf->decided) read(*leaf, leaf->origin - lowest_);
        }
      }
    }
  }
}

void OpenSurroundings::read(const OpenLeaf& leaf, const Coord& from) {
  const auto begin = [&](int axis) { return std::max(0, -from[axis]); };
  const auto end = [&](int axis) { return std::min(leaf_layers, edges_[axis] - from[axis]); };
  if (begin(0) >= end(0) || begin(1) >= end(1) || begin(2) >= end(2)) return;
  // Of a plane of equal x, the rows along z that lie in here, and those before them.
  const std::uint64_t before = (std::uint64_t{1} << (leaf_layers * begin(1))) - 1;
  const std::uint64_t rows = ~std::uint64_t{0} >> (leaf_layers * (leaf_layers - end(1))) & ~before;
  const unsigned kept = (1U << end(2)) - (1U << begin(2));
  for (int x = begin(0); x < end(0); ++x) {
    const std::uint64_t open = leaf.open[static_cast<std::size_t>(x)];
    const OpenVoxel* voxel = leaf.voxels.data() + leaf.first[static_cast<std::size_t>(x)];
    if (before != 0) voxel += std::popcount(open & before);
    forEachBit(open & rows, [&](unsigned number) {
      const OpenVoxel& here = *voxel++;
      if ((kept >> number % leaf_layers & 1) == 0) return;
      const int z = from.z() + static_cast<int>(number % leaf_layers);
      const std::size_t column =
          columnOf(from.x() + x, from.y() + static_cast<int>(number / leaf_layers));
      present_[column] |= std::uint64_t{1} << z;
      const std::size_t to = column * stride_ + static_cast<std::size_t>(z);
      depths_[to] = here.depth;
      errors_[to] = here.error;
    });
  }
}

void OpenSurroundings::set(const Coord& ijk, const OpenVoxel& voxel) {
  const Coord at = ijk - lowest_;
  const std::size_t column = columnOf(at.x(), at.y());
  if (column != own_column_) own_column_ = no_column;
  present_[column] |= std::uint64_t{1} << at.z();
  const std::size_t to = column * stride_ + static_cast<std::size_t>(at.z());
  depths_[to] = voxel.depth;
  errors_[to] = voxel.error;
}

float OpenSurroundings::sum(const Coord& ijk, float depth) {
  const Coord at = ijk - lowest_;
  if (columnOf(at.x(), at.y()) != own_column_) lookAround(at.x(), at.y());
  return sum_(*this, static_cast<unsigned>(at.z()), depth);
}

void OpenSurroundings::lookAround(int x, int y) {
  own_column_ = columnOf(x, y);
  near_count_ = 0;
  for (const HeightKernel::Column& column : kernel_.columns()) {
    const std::size_t there = columnOf(x + column.x, y + column.y);
    near_[near_count_] = {&present_[there], static_cast<std::uint32_t>(there * stride_),
                          column.apart2, static_cast<unsigned>(column.z)};
    // Without a branch, which would often be foretold wrongly.
    near_count_ += static_cast<std::size_t>(present_[there] != 0 || there == own_column_);
  }
}

}  // namespace vdbdither
