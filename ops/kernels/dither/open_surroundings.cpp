#include "ops/kernels/dither/open_surroundings.h"

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

#include "ops/kernels/leaf/floats.h"

namespace vdbdither {

using openvdb::Coord;

namespace {

constexpr std::size_t no_column = std::numeric_limits<std::size_t>::max();

/// Voxels, and columns, are read by eight.
constexpr std::size_t by = 8;

/// Returns a bit for each byte of eight words that is not zero after the shift within its window.
inline std::uint64_t bytesWithin(const std::uint64_t* words, const std::uint64_t* windows,
                                 unsigned shift) {
  std::uint64_t found = 0;
#ifdef __SSE2__
  const auto load = [](const std::uint64_t* from) {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
  };
  const __m128i count = _mm_cvtsi32_si128(static_cast<int>(shift));
  for (unsigned n = 0; n < by; n += 2) {
    const __m128i within = _mm_and_si128(_mm_srl_epi64(load(words + n), count), load(windows + n));
    const auto zero =
        static_cast<unsigned>(_mm_movemask_epi8(_mm_cmpeq_epi8(within, _mm_setzero_si128())));
    found |= std::uint64_t{zero ^ 0xffffU} << (8 * n);
  }
#else
  for (unsigned n = 0; n < by; ++n) {
    const std::uint64_t within = words[n] >> shift & windows[n];
    for (unsigned byte = 0; byte < 8; ++byte)
      found |= std::uint64_t{(within >> (8 * byte) & 0xff) != 0} << (8 * n + byte);
  }
#endif
  return found;
}

template <typename Lanes>
[[gnu::always_inline]] inline void load(const float* from, Lanes& values) {
  std::memcpy(&values, from, sizeof values);
}

}  // namespace

/// The sum, compiled for each instruction set and number of hills.
struct OpenSurroundings::Loops {
  template <typename Lanes, std::size_t hill_count>
  [[gnu::always_inline]] static float sumOf(const OpenSurroundings& around, unsigned z,
                                            float depth) {
    const Near& near = around.near_;
    const HeightKernel::Hill* hills = around.kernel_.hills().data();
    const float* all_apart2 = around.kernel_.apart2().data();
    const float* all_depths = around.depths_.data() + z;
    const float* all_errors = around.errors_.data() + z;
    Floats sum{};
    for (std::size_t first = 0; first < near.count; first += by) {
      forEachBit(bytesWithin(&near.present[first], &near.window[first], z), [&](unsigned found) {
        const std::size_t column = first + found / 8;
        const std::size_t group = by * (found % 8);
        addGroup<Lanes, hill_count>(all_apart2 + near.apart2[column] + group,
                                    all_depths + near.voxels[column] + group,
                                    all_errors + near.voxels[column] + group, hills, depth, sum);
      });
    }
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
  }

  /// Adds eight voxels.
  template <typename Lanes, std::size_t hill_count>
  [[gnu::always_inline]] static void addGroup(const float* from_apart2, const float* from_depths,
                                              const float* from_errors,
                                              const HeightKernel::Hill* hills, float depth,
                                              Floats& sum) {
    constexpr std::size_t lanes = sizeof(Lanes) / sizeof(float);
    for (std::size_t n = 0; n < by; n += lanes) {
      Lanes apart2, depths, errors, w;
      load(from_apart2 + n, apart2);
      load(from_depths + n, depths);
      load(from_errors + n, errors);
      const Lanes deeper = depth - depths;
      const Lanes x = apart2 - deeper * deeper;
      hills[0].weigh(x, w);
      if constexpr (hill_count == 2) {
        Lanes wide;
        hills[1].weigh(x, wide);
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
  }

  template <std::size_t hill_count>
  static float sumBaseline(const OpenSurroundings& around, unsigned z, float depth) {
    return sumOf<Floats, hill_count>(around, z, depth);
  }

#if defined(__x86_64__)
  template <std::size_t hill_count>
  [[gnu::target("avx2")]] static float sumAvx2(const OpenSurroundings& around, unsigned z,
                                               float depth) {
    return sumOf<EightFloats, hill_count>(around, z, depth);
  }
#endif
};

OpenSurroundings::Near::Near(std::size_t columns)
    : middle(no_column), present(columns), window(columns), voxels(columns), apart2(columns) {}

OpenSurroundings::OpenSurroundings(const HeightKernel& kernel, const BlockOrder& order,
                                   [[maybe_unused]] InstructionSet instructions)
    : kernel_(kernel),
      order_(order),
      sum_(kernel.hills().size() == 1 ? &Loops::sumBaseline<1> : &Loops::sumBaseline<2>),
      reach_(kernel.reach()),
      edges_(order.edges() + reach_ + reach_),
      stride_(static_cast<std::size_t>(edges_.z()) + by - 1),
      present_(static_cast<std::size_t>(edges_.x() * edges_.y())),
      depths_(present_.size() * stride_),
      errors_(present_.size() * stride_),
      near_(kernel.columns().size() + by) {
  static_assert(4 * HeightKernel::maximum_reach <= 64, "a column fits into a word, and its shift");
#if defined(__x86_64__)
  if (instructions == InstructionSet::avx2)
    sum_ = kernel.hills().size() == 1 ? &Loops::sumAvx2<1> : &Loops::sumAvx2<2>;
#endif
  for (const HeightKernel::Column& column : kernel.columns())
    seen_.push_back({column.x * edges_.y() + column.y, column.apart2, column.z});
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
  near_.middle = no_column;
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
  present_[column] |= std::uint64_t{1} << at.z();
  const std::size_t to = column * stride_ + static_cast<std::size_t>(at.z());
  depths_[to] = voxel.depth;
  errors_[to] = voxel.error;
  if (column == near_.middle) {
    near_.present[near_.own] = present_[column] << near_.own_half;
  } else {
    near_.middle = no_column;
  }
}

float OpenSurroundings::sum(const Coord& ijk, float depth) {
  const Coord at = ijk - lowest_;
  const std::size_t column = columnOf(at.x(), at.y());
  if (column != near_.middle) lookAround(column);
  return sum_(*this, static_cast<unsigned>(at.z()), depth);
}

void OpenSurroundings::lookAround(std::size_t column) {
  near_.middle = column;
  std::size_t count = 0;
  for (const Seen& seen : seen_) {
    const std::size_t there = column + static_cast<std::size_t>(seen.column);
    if (seen.column == 0) {
      near_.own = count;
      near_.own_half = seen.half;
    }
    near_.present[count] = present_[there] << seen.half;
    near_.window[count] = (std::uint64_t{2} << (2 * seen.half)) - 1;
    near_.voxels[count] = static_cast<std::ptrdiff_t>(there * stride_) - seen.half;
    near_.apart2[count] = seen.apart2;
    // Without a branch, which would often be mispredicted.
    count += static_cast<std::size_t>(present_[there] != 0 || seen.column == 0);
  }
  near_.count = (count + by - 1) / by * by;
  std::fill(near_.present.begin() + static_cast<std::ptrdiff_t>(count),
            near_.present.begin() + static_cast<std::ptrdiff_t>(near_.count), 0);
}

}  // namespace vdbdither
