// Void and cluster: Ulichney, "The void-and-cluster method for dither array generation", SPIE 1913
// (1993), in N dimensions as Peters, "Free blue noise textures" (2016). Ulichney's third phase,
// which takes the tightest clusters of unset voxels, is the second one continued: on the torus the
// energies by set and by unset voxels add up to a constant.
#include "ops/kernels/void_and_cluster.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace vdbdither {

namespace {

using Energy = std::int64_t;

/// Set voxels carry this on top of their energy: the least energy is always a void, the greatest a
/// cluster.
constexpr Energy set_bias = Energy{1} << 62;

/// Weights are added in whole registers: rows of weights are followed by as many zeros as a
/// register holds, and lines of energies by as many values that mean nothing. (A cache line of them
/// also keeps lines from falling on each other in the cache.)
constexpr int lanes = 4;
constexpr int line_padding = 8;

/// The weights of a kernel along x, at one offset in y and z.
struct KernelRow {
  int x, y, z;        ///< offset of the first weight, each in [0, size)
  int count;          ///< weights, without the zeros that follow them
  std::size_t first;  ///< of the weights
};

struct IntegerKernel {
  std::vector<KernelRow>
      rows;  ///< by falling count of registers, so that branches are foreseen; then by z and y
  std::vector<Energy> weights;
  bool negative = false;  ///< whether any weight is
};

int bitsFor(double value) { return std::max(0, static_cast<int>(std::ceil(std::log2(value)))); }

/// The kernel as integers times 2^tie_bits, as fine as the sum over a tile allows.
IntegerKernel integerKernel(const VoidAndCluster& settings, int tie_bits) {
  const openvdb::Coord& size = settings.size;
  const ToroidalKernel kernel(settings.kernel, size);
  const double smallest = smallestWeight(settings);
  double sum = 0;
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x) sum += std::abs(kernel(x, y, z));
    }
  }
  const double scale = std::ldexp(1.0, std::min(40, 60 - tie_bits - bitsFor(sum)));

  IntegerKernel result;
  std::vector<Energy> row(size.x());
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      const int begin = -(size.x() / 2);
      int first = size.x();
      int last = -1;
      for (int i = 0; i < size.x(); ++i) {
        const int x = begin + i;
        const double weight = kernel(x < 0 ? x + size.x() : x, y, z);
        row[i] = std::abs(weight) < smallest
                     ? 0
                     : std::llround(weight * scale) * (Energy{1} << tie_bits);
        if (row[i] == 0) continue;
        first = std::min(first, i);
        last = i;
      }
      if (last < 0) continue;
      const int x = begin + first;
      result.rows.push_back(
          {x < 0 ? x + size.x() : x, y, z, last - first + 1, result.weights.size()});
      for (int i = first; i <= last; ++i) {
        result.weights.push_back(row[i]);
        result.negative |= row[i] < 0;
      }
      result.weights.resize(result.weights.size() + lanes);
    }
  }
  std::stable_sort(result.rows.begin(), result.rows.end(),
                   [](const KernelRow& a, const KernelRow& b) {
                     return (a.count - 1) / lanes > (b.count - 1) / lanes;
                   });
  return result;
}

/// A tile of energies: lines along x, one after the other in y, then z.
class Tile {
 public:
  explicit Tile(const openvdb::Coord& size)
      : size_(size),
        line_(size.x() + line_padding),
        energies_(line_ * static_cast<std::size_t>(size.y()) * size.z()) {}

  [[nodiscard]] const openvdb::Coord& size() const { return size_; }
  [[nodiscard]] Energy* line(int y, int z) { return energies_.data() + line_ * lineIndex(y, z); }
  [[nodiscard]] const Energy* line(int y, int z) const {
    return energies_.data() + line_ * lineIndex(y, z);
  }
  [[nodiscard]] std::size_t lineIndex(int y, int z) const {
    return y + static_cast<std::size_t>(size_.y()) * z;
  }
  [[nodiscard]] Energy& at(const openvdb::Coord& voxel) {
    return line(voxel.y(), voxel.z())[voxel.x()];
  }

 private:
  openvdb::Coord size_;
  std::size_t line_;
  std::vector<Energy> energies_;
};

int wrapped(int value, int period) { return value < period ? value : value - period; }

/// Adds sign · weight to `count` energies, and zero or junk to the padding behind them.
template <int sign>
[[gnu::always_inline]] inline void addWeights(Energy* __restrict energies,
                                              const Energy* __restrict weights, int count) {
  for (int i = 0; i < count; i += lanes) {
    for (int lane = 0; lane < lanes; ++lane) energies[i + lane] += sign * weights[i + lane];
  }
}

/// Adds the kernel around `centre` (sign 1) or takes it away (sign -1).
template <int sign>
[[gnu::always_inline]] inline void deposit(Tile& tile, const IntegerKernel& kernel,
                                           const openvdb::Coord& centre) {
  const openvdb::Coord size = tile.size();
  for (const KernelRow& row : kernel.rows) {
    Energy* const line =
        tile.line(wrapped(centre.y() + row.y, size.y()), wrapped(centre.z() + row.z, size.z()));
    const Energy* const weights = kernel.weights.data() + row.first;
    const int x = wrapped(centre.x() + row.x, size.x());
    const int before_seam = std::min(row.count, size.x() - x);
    addWeights<sign>(line + x, weights, before_seam);
    if (before_seam < row.count)
      addWeights<sign>(line, weights + before_seam, row.count - before_seam);
  }
}

/// The least of sign · value over `count` ≥ 1 values.
template <int sign>
[[gnu::always_inline]] inline Energy leastOf(const Energy* values, int count) {
  Energy least = std::numeric_limits<Energy>::max();
  for (int i = 0; i < count; ++i) least = std::min(least, sign * values[i]);
  return least;
}

/// Lower bounds of sign · energy.
struct Bounds {
  std::vector<Energy> lines;
  std::vector<Energy> layers;  ///< the least of the lines of each
};

/// Lowers the bounds to the energies that the kernel around `centre` covers.
template <int sign>
[[gnu::always_inline]] inline void lowerBounds(const Tile& tile, const IntegerKernel& kernel,
                                               const openvdb::Coord& centre, Bounds& bounds) {
  const openvdb::Coord size = tile.size();
  for (const KernelRow& row : kernel.rows) {
    const int y = wrapped(centre.y() + row.y, size.y());
    const int z = wrapped(centre.z() + row.z, size.z());
    const Energy* const line = tile.line(y, z);
    const int x = wrapped(centre.x() + row.x, size.x());
    const int before_seam = std::min(row.count, size.x() - x);
    Energy least = leastOf<sign>(line + x, before_seam);
    if (before_seam < row.count)
      least = std::min(least, leastOf<sign>(line, row.count - before_seam));
    Energy& bound = bounds.lines[tile.lineIndex(y, z)];
    bound = std::min(bound, least);
    bounds.layers[z] = std::min(bounds.layers[z], least);
  }
}

/// The loops above, compiled for an instruction set.
template <int sign>
struct Loops {
  void (*deposit)(Tile&, const IntegerKernel&, const openvdb::Coord&);
  Energy (*least)(const Energy*, int);
  void (*lower_bounds)(const Tile&, const IntegerKernel&, const openvdb::Coord&, Bounds&);
};

template <int sign>
constexpr Loops<sign> baseline_loops{
    [](Tile& tile, const IntegerKernel& kernel, const openvdb::Coord& centre) {
      deposit<sign>(tile, kernel, centre);
    },
    [](const Energy* values, int count) { return leastOf<sign>(values, count); },
    [](const Tile& tile, const IntegerKernel& kernel, const openvdb::Coord& centre,
       Bounds& bounds) { lowerBounds<sign>(tile, kernel, centre, bounds); }};

#if defined(__x86_64__)
template <int sign>
[[gnu::target("avx2")]] void depositAvx2(Tile& tile, const IntegerKernel& kernel,
                                         const openvdb::Coord& centre) {
  deposit<sign>(tile, kernel, centre);
}
template <int sign>
[[gnu::target("avx2")]] Energy leastAvx2(const Energy* values, int count) {
  return leastOf<sign>(values, count);
}
template <int sign>
[[gnu::target("avx2")]] void lowerBoundsAvx2(const Tile& tile, const IntegerKernel& kernel,
                                             const openvdb::Coord& centre, Bounds& bounds) {
  lowerBounds<sign>(tile, kernel, centre, bounds);
}
template <int sign>
constexpr Loops<sign> avx2_loops{depositAvx2<sign>, leastAvx2<sign>, lowerBoundsAvx2<sign>};
#else
template <int sign>
constexpr Loops<sign> avx2_loops = baseline_loops<sign>;
#endif

template <int sign>
const Loops<sign>& loops(InstructionSet instructions) {
  return instructions == InstructionSet::avx2 ? avx2_loops<sign> : baseline_loops<sign>;
}

constexpr Energy lowest = std::numeric_limits<Energy>::min();

/// Finds the voxel where sign · energy is least. Holds a lower bound for every line and every layer
/// of lines, and looks again only at the line whose bound is least: energies that rise leave the
/// bounds true.
template <int sign>
class Extremum {
 public:
  Extremum(const Tile& tile, InstructionSet instructions)
      : tile_(tile),
        energies_(loops<sign>(instructions)),
        least_bound_(loops<1>(instructions).least),
        bounds_{std::vector<Energy>(tile.lineIndex(0, tile.size().z()), lowest),
                std::vector<Energy>(tile.size().z(), lowest)} {}

  /// Keeps the bounds true after the kernel around `centre` was added (change 1) or taken away
  /// (change -1).
  void follow(const IntegerKernel& kernel, const openvdb::Coord& centre, int change) {
    if (change == sign && !kernel.negative) return;
    energies_.lower_bounds(tile_, kernel, centre, bounds_);
  }

  openvdb::Coord find() {
    const Energy* exact = nullptr;
    while (true) {
      const int z = whereLeast(bounds_.layers.data(), tile_.size().z());
      Energy* const layer = bounds_.lines.data() + tile_.lineIndex(0, z);
      const int y = whereLeast(layer, tile_.size().y());
      const Energy* const line = tile_.line(y, z);
      if (line == exact) return {where(line, sign * layer[y]), y, z};
      layer[y] = energies_.least(line, tile_.size().x());
      bounds_.layers[z] = least_bound_(layer, tile_.size().y());
      exact = line;
    }
  }

 private:
  static int where(const Energy* values, Energy value) {
    int i = 0;
    while (values[i] != value) ++i;
    return i;
  }
  int whereLeast(const Energy* values, int count) const {
    return where(values, least_bound_(values, count));
  }

  const Tile& tile_;
  const Loops<sign>& energies_;
  Energy (*least_bound_)(const Energy*, int);
  Bounds bounds_;
};

/// Counts the steps of a run and reports now and then.
class Progress {
 public:
  Progress(const std::function<void(double)>& report, double steps)
      : report_(report), steps_(steps) {}
  void step() {
    if (++done_ % 1024 == 0 && report_) report_(std::min(1.0, static_cast<double>(done_) / steps_));
  }

 private:
  const std::function<void(double)>& report_;
  double steps_;
  std::uint64_t done_ = 0;
};

std::uint64_t nextRandom(std::uint64_t& state) {  // SplitMix64
  std::uint64_t z = (state += 0x9e3779b97f4a7c15u);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

}  // namespace

InstructionSet bestInstructionSet() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) return InstructionSet::avx2;
#endif
  return InstructionSet::baseline;
}

std::vector<std::uint32_t> randomPermutation(std::uint32_t count, std::uint64_t seed) {
  std::vector<std::uint32_t> permutation(count);
  std::iota(permutation.begin(), permutation.end(), 0u);
  for (std::uint32_t left = count; left > 1; --left) {
    const std::uint64_t pick = (nextRandom(seed) >> 32) * left >> 32;
    std::swap(permutation[left - 1], permutation[pick]);
  }
  return permutation;
}

std::uint32_t initialCount(std::uint32_t count) {
  return std::max(1u, std::min((count - 1) / 2, count / 10));
}

double smallestWeight(const VoidAndCluster& settings) {
  const openvdb::Coord& size = settings.size;
  if (static_cast<std::size_t>(size.x()) * size.y() * size.z() <= 32768) return 0;
  return std::ldexp(1.0, settings.kernel.shape == MaskKernel::Shape::peters ? -16 : -40);
}

std::vector<std::uint32_t> voidAndCluster(const VoidAndCluster& settings,
                                          const std::function<void(double fraction)>& progress,
                                          InstructionSet instructions) {
  const auto count =
      static_cast<std::uint32_t>(settings.size.x()) * settings.size.y() * settings.size.z();
  const std::uint32_t initial = initialCount(count);
  const std::vector<std::uint32_t> ties = randomPermutation(count, settings.seed);
  const IntegerKernel kernel = integerKernel(settings, bitsFor(count));

  Tile tile(settings.size);
  const auto index = [&](const openvdb::Coord& voxel) {
    return voxel.x() +
           static_cast<std::size_t>(settings.size.x()) * tile.lineIndex(voxel.y(), voxel.z());
  };
  const auto set = [&](const openvdb::Coord& voxel) {
    loops<1>(instructions).deposit(tile, kernel, voxel);
    tile.at(voxel) += set_bias;
  };
  const auto clear = [&](const openvdb::Coord& voxel) {
    loops<-1>(instructions).deposit(tile, kernel, voxel);
    tile.at(voxel) -= set_bias;
  };
  Progress work(progress, count + 1.4 * initial);

  std::uint32_t i = 0;
  for (int z = 0; z < settings.size.z(); ++z) {
    for (int y = 0; y < settings.size.y(); ++y) {
      for (int x = 0; x < settings.size.x(); ++x) tile.at({x, y, z}) += ties[i++];
    }
  }
  i = 0;
  for (int z = 0; z < settings.size.z(); ++z) {
    for (int y = 0; y < settings.size.y(); ++y) {
      for (int x = 0; x < settings.size.x(); ++x) {
        if (ties[i++] < initial) set({x, y, z});
      }
    }
  }
  {
    Extremum<1> voids(tile, instructions);
    Extremum<-1> clusters(tile, instructions);
    while (true) {
      const openvdb::Coord from = clusters.find();
      clear(from);
      voids.follow(kernel, from, -1);
      clusters.follow(kernel, from, -1);
      const openvdb::Coord to = voids.find();
      set(to);
      if (to == from) break;
      voids.follow(kernel, to, 1);
      clusters.follow(kernel, to, 1);
      work.step();
    }
  }
  std::vector<std::uint32_t> ranks(count);
  const Tile converged = tile;
  Extremum<-1> clusters(tile, instructions);
  for (std::uint32_t rank = initial; rank-- > 0;) {
    const openvdb::Coord at = clusters.find();
    ranks[index(at)] = rank;
    clear(at);
    clusters.follow(kernel, at, -1);
    work.step();
  }
  tile = converged;
  Extremum<1> voids(tile, instructions);
  for (std::uint32_t rank = initial; rank < count; ++rank) {
    const openvdb::Coord at = voids.find();
    ranks[index(at)] = rank;
    set(at);
    voids.follow(kernel, at, 1);
    work.step();
  }
  return ranks;
}

}  // namespace vdbdither
