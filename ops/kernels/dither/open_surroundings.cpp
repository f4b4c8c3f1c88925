#include "ops/kernels/dither/open_surroundings.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <bit>

#include "ops/kernels/leaf/floats.h"

namespace vdbdither {

using openvdb::Coord;

namespace {

/// Begins to read voxels into the cache.
void prefetch(std::span<const OpenVoxel> voxels) {
  constexpr std::size_t line = 64 / sizeof(OpenVoxel);
  for (std::size_t n = 0; n < voxels.size(); n += line) __builtin_prefetch(&voxels[n]);
}

/// Voxels are read by eight.
constexpr std::size_t by = 8;

/// A word has one bit for every eight voxels of some columns that may have to be read: two bits for
/// each of 32 columns that are short, else eight bits for each of eight columns.
constexpr unsigned bitsPerColumn(bool flat) { return flat ? 2 : 8; }
constexpr std::size_t foursPerWord(bool flat) { return 16 / bitsPerColumn(flat); }

}  // namespace

/// The sum, compiled for each instruction set, number of hills and length of columns.
struct OpenSurroundings::Loops {
  /// Adds eight voxels.
  template <typename Lanes, std::size_t hill_count>
  [[gnu::always_inline]] static void addEight(const float* from_apart2, const float* from_depths,
                                              const float* from_errors,
                                              const HeightKernel::Hill* hills, float depth,
                                              Floats& sum) {
    constexpr std::size_t lanes = sizeof(Lanes) / sizeof(float);
    for (std::size_t n = 0; n < by; n += lanes) {
      Lanes apart2, depths, errors, w;
      loadLanes(from_apart2 + n, apart2);
      loadLanes(from_depths + n, depths);
      loadLanes(from_errors + n, errors);
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

  /// Adds the voxels that `found`, a word, refers to by `eights`.
  template <typename Lanes, std::size_t hill_count>
  [[gnu::always_inline]] static void addFound(const OpenSurroundings& around, std::uint64_t found,
                                              const Eight* eights, std::size_t middle, float depth,
                                              Floats& sum) {
    const HeightKernel::Hill* hills = around.kernel_.hills().data();
    const float* apart2 = around.kernel_.apart2().data();
    const float* depths = around.depths_.data() + middle;
    const float* errors = around.errors_.data() + middle;
    for (; found != 0; found &= found - 1) {
      const Eight& eight = eights[static_cast<unsigned>(std::countr_zero(found))];
      addEight<Lanes, hill_count>(apart2 + eight.apart2, depths + eight.voxels,
                                  errors + eight.voxels, hills, depth, sum);
    }
  }

  static float total(const Floats& sum) { return (sum[0] + sum[2]) + (sum[1] + sum[3]); }

  template <std::size_t hill_count, bool flat>
  static float sumBaseline(const OpenSurroundings& around, std::size_t column, std::size_t z,
                           float depth) {
    const std::uint64_t* present = around.present_.data() + column;
    const Eight* eights = around.eights_.data();
    const std::size_t middle = column * around.stride_ + z;
    Floats sum{};
    for (const Four& four : around.fours_) {
      for (std::size_t lane = 0; lane < 4; ++lane, eights += bitsPerColumn(flat)) {
        const std::uint64_t within =
            present[four.first + static_cast<std::ptrdiff_t>(lane)] >> (z - four.half[lane]) &
            four.window[lane];
        std::uint64_t found = 0;
        for (unsigned byte = 0; byte < bitsPerColumn(flat); ++byte)
          found |= std::uint64_t{(within >> (8 * byte) & 0xff) != 0} << byte;
        addFound<Floats, hill_count>(around, found, eights, middle, depth, sum);
      }
    }
    return total(sum);
  }

#if defined(__x86_64__)
  [[gnu::target("avx2"), gnu::always_inline]] static inline __m256i wordsAt(
      const std::uint64_t* from) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
  }

  /// The voxels of four columns from the lowest within the kernel on, as bits.
  struct Seen {
    const std::uint64_t* present;  ///< of the column in the middle
    const Four* middle;            ///< holds this column
    std::array<std::uint64_t, 4> own;
    __m256i z;
    [[gnu::target("avx2"), gnu::always_inline]] inline __m256i operator()(const Four& four) const {
      const std::uint64_t* words = &four == middle ? own.data() : present + four.first;
      const __m256i below = _mm256_sub_epi64(z, wordsAt(four.half.data()));
      return _mm256_and_si256(_mm256_srlv_epi64(wordsAt(words), below),
                              wordsAt(four.window.data()));
    }
  };

  /// A bit for each byte that is not zero.
  [[gnu::target("avx2"), gnu::always_inline]] static inline std::uint32_t bytesOf(__m256i bits) {
    return ~static_cast<std::uint32_t>(
        _mm256_movemask_epi8(_mm256_cmpeq_epi8(bits, _mm256_setzero_si256())));
  }

  template <std::size_t hill_count, bool flat>
  [[gnu::target("avx2")]] static float sumAvx2(const OpenSurroundings& around, std::size_t column,
                                               std::size_t z, float depth) {
    const std::uint64_t* present = around.present_.data() + column;
    const Eight* eights = around.eights_.data();
    const std::size_t middle = column * around.stride_ + z;
    const Four* middle_four = &around.fours_[around.own_];
    Seen seen{present, middle_four, {}, _mm256_set1_epi64x(static_cast<long long>(z))};
    // Read one by one: a word that was just written is not ready for a read of four.
    const volatile std::uint64_t* beside = present + middle_four->first;
    const auto word = [](std::uint64_t bits) { return static_cast<long long>(bits); };
    _mm256_storeu_si256(
        reinterpret_cast<__m256i*>(seen.own.data()),
        _mm256_set_epi64x(word(beside[3]), word(beside[2]), word(beside[1]), word(beside[0])));
    const Four* const end = around.fours_.data() + around.fours_.size();
    Floats sum{};
    for (const Four* four = around.fours_.data(); four != end; four += foursPerWord(flat)) {
      std::uint64_t found = 0;
      if constexpr (flat) {
        // A lane has 16 bits of four columns that lie in four groups; these are sorted by groups.
        const __m256i in_lane =
            _mm256_setr_epi8(0, 1, 8, 9, 2, 3, 10, 11, 4, 5, 12, 13, 6, 7, 14, 15, 0, 1, 8, 9, 2, 3,
                             10, 11, 4, 5, 12, 13, 6, 7, 14, 15);
        const __m256i across = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
        for (int half = 0; half < 2; ++half) {
          const Four* some = four + 4 * half;
          const __m256i low = _mm256_or_si256(seen(some[0]), _mm256_slli_epi64(seen(some[1]), 16));
          const __m256i high = _mm256_or_si256(_mm256_slli_epi64(seen(some[2]), 32),
                                               _mm256_slli_epi64(seen(some[3]), 48));
          const __m256i sorted = _mm256_permutevar8x32_epi32(
              _mm256_shuffle_epi8(_mm256_or_si256(low, high), in_lane), across);
          found |= std::uint64_t{bytesOf(sorted)} << (32 * half);
        }
      } else {
        found = bytesOf(seen(four[0])) | std::uint64_t{bytesOf(seen(four[1]))} << 32;
      }
      addFound<EightFloats, hill_count>(around, found, eights, middle, depth, sum);
      eights += 64;
    }
    return total(sum);
  }
#endif

  template <std::size_t hill_count, bool flat>
  static auto of([[maybe_unused]] InstructionSet instructions) {
#if defined(__x86_64__)
    if (instructions == InstructionSet::avx2) return &sumAvx2<hill_count, flat>;
#endif
    return &sumBaseline<hill_count, flat>;
  }
};

OpenSurroundings::OpenSurroundings(const HeightKernel& kernel, const BlockOrder& order,
                                   InstructionSet instructions)
    : kernel_(kernel),
      order_(order),
      halo_(kernel.reach().x(), kernel.reach().y(),
            (kernel.reach().z() + leaf_layers - 1) / leaf_layers * leaf_layers),
      edges_(order.edges() + halo_ + halo_),
      stride_(static_cast<std::size_t>(edges_.z())),
      // Columns are looked at by four; a sum reads up to seven voxels beyond its last column.
      present_(static_cast<std::size_t>(edges_.x() * edges_.y()) + 3),
      depths_(present_.size() * stride_ + by),
      errors_(depths_.size()),
      flat_(kernel.reach().z() < static_cast<int>(by)) {
  static_assert(4 * HeightKernel::maximum_reach <= 64, "a column fits into a word");
  const std::vector<HeightKernel::Column>& columns = kernel.columns();
  for (std::size_t first = 0; first < columns.size();) {
    std::size_t next = first;
    while (next < columns.size() && columns[next].x == columns[first].x) ++next;
    addFours({&columns[first], next - first});
    first = next;
  }
  const auto own = std::find_if(fours_.begin(), fours_.end(), [](const Four& four) {
    return four.first <= 0 && four.first + 4 > 0;
  });
  own_ = static_cast<std::size_t>(own - fours_.begin());
  while (fours_.size() % foursPerWord(flat_) != 0) fours_.push_back({});
  eights_.resize(fours_.size() * 4 * bitsPerColumn(flat_));

  const bool single = kernel.hills().size() == 1;
  if (flat_) {
    sum_ = single ? Loops::of<1, true>(instructions) : Loops::of<2, true>(instructions);
  } else {
    sum_ = single ? Loops::of<1, false>(instructions) : Loops::of<2, false>(instructions);
  }
}

/// Adds the columns of the kernel at one x, which follow each other along y.
void OpenSurroundings::addFours(std::span<const HeightKernel::Column> columns) {
  for (std::size_t n = 0; n < columns.size(); n += 4) {
    Four four{};
    four.first = std::ptrdiff_t{columns[n].x} * edges_.y() + columns[n].y;
    eights_.resize(eights_.size() + 4 * bitsPerColumn(flat_));
    Eight* eight = eights_.data() + eights_.size() - 4 * bitsPerColumn(flat_);
    for (std::size_t lane = 0; lane < std::min<std::size_t>(4, columns.size() - n); ++lane) {
      const HeightKernel::Column& column = columns[n + lane];
      four.half[lane] = static_cast<std::uint64_t>(column.z);
      four.window[lane] = (std::uint64_t{2} << (2 * column.z)) - 1;
      const int lowest = (column.x * edges_.y() + column.y) * edges_.z() - column.z;
      for (int byte = 0; byte < static_cast<int>(bitsPerColumn(flat_)); ++byte, ++eight)
        *eight = {std::ptrdiff_t{column.apart2} + byte * 8, lowest + byte * 8};
    }
    fours_.push_back(four);
  }
}

void OpenSurroundings::visit(OpenLeaves::Block block, OpenLeaves::Finder& find) {
  std::fill(present_.begin(), present_.end(), 0);
  std::fill(errors_.begin(), errors_.end(), 0.0F);
  const Coord origin = block.front()->origin;
  lowest_ = order_.cornerOf(origin) - halo_;
  const Coord index = order_.blockOf(origin);
  leaves_.clear();
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        for (const OpenLeaf* leaf : find(index.offsetBy(x, y, z))) {
          __builtin_prefetch(leaf);
          __builtin_prefetch(&leaf->open);
          leaves_.push_back(leaf);
        }
      }
    }
  }
  std::erase_if(leaves_, [](const OpenLeaf* leaf) { return !leaf->decided; });
  for (std::size_t n = 0; n < leaves_.size(); ++n) {
    if (n + 2 < leaves_.size()) prefetch(leaves_[n + 2]->voxels);
    read<true>(*leaves_[n], leaves_[n]->origin - lowest_);
  }
  for (const OpenLeaf* leaf : block) {
    if (!leaf->decided) read<false>(*leaf, leaf->origin - lowest_);
  }
}

/// Along z, the surroundings have all of a leaf or nothing.
template <bool decided>
void OpenSurroundings::read(const OpenLeaf& leaf, const Coord& from) {
  const auto begin = [&](int axis) { return std::max(0, -from[axis]); };
  const auto end = [&](int axis) { return std::min(leaf_layers, edges_[axis] - from[axis]); };
  if (begin(0) >= end(0) || begin(1) >= end(1) || begin(2) >= end(2)) return;
  // Of a plane of equal x, the rows along z that lie in here, and those before them.
  const std::uint64_t before = (std::uint64_t{1} << (leaf_layers * begin(1))) - 1;
  const std::uint64_t rows = ~std::uint64_t{0} >> (leaf_layers * (leaf_layers - end(1))) & ~before;
  for (int x = begin(0); x < end(0); ++x) {
    const std::uint64_t open = leaf.open[static_cast<std::size_t>(x)];
    const OpenVoxel* voxel = leaf.voxels.data() + leaf.first[static_cast<std::size_t>(x)];
    if (before != 0) voxel += std::popcount(open & before);
    const std::ptrdiff_t plane = std::ptrdiff_t{from.x() + x} * edges_.y() + from.y();
    forEachBit(open & rows, [&](unsigned number) {
      const auto column = static_cast<std::size_t>(plane + number / leaf_layers);
      const std::size_t z = static_cast<std::size_t>(from.z()) + number % leaf_layers;
      depths_[column * stride_ + z] = voxel->depth;
      if (decided) put(column, z, voxel->error);
      ++voxel;
    });
  }
}

}  // namespace vdbdither
