// Void and cluster: Ulichney, "The void-and-cluster method for dither array generation", SPIE 1913
// (1993), in N dimensions as by Peters, "Free blue noise textures" (2016). Ulichney's third phase,
// which removes the tightest clusters of unset voxels, is the second one continued: on the torus
// the energies of set and of unset voxels add up to a constant.
//
// The next voxel can lie anywhere in the tile, so that cache lines determine the time. Energies are
// stored in bricks of one line; the kernel is cut into the same bricks, once for every position of
// its centre in a brick; and the extremum is found through lower bounds that are updated only when
// they are the minimum.
#include "ops/kernels/mask/void_and_cluster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "vdbdither/model/split_mix.h"

namespace vdbdither {

namespace {

using openvdb::Coord;

constexpr std::size_t whole_brick = 16;

/// The storage order of voxels: bricks of 4 × 2 × 2 voxels, one after the other; shorter along axes
/// that these do not divide.
class Bricks {
 public:
  explicit Bricks(const Coord& size) : size_(size) {
    for (int axis = 0; axis < 3; ++axis) {
      int& edge = edge_[axis];
      edge = axis == 0 ? 4 : 2;
      while (size[axis] % edge != 0) edge /= 2;
      count_[axis] = size[axis] / edge;
    }
  }

  [[nodiscard]] const Coord& size() const { return size_; }
  [[nodiscard]] const Coord& edge() const { return edge_; }
  /// Bricks along each axis.
  [[nodiscard]] const Coord& count() const { return count_; }
  /// Voxels in a brick.
  [[nodiscard]] std::size_t volume() const { return volume(edge_); }
  [[nodiscard]] std::size_t voxels() const { return volume(size_); }

  [[nodiscard]] Coord brickOf(const Coord& voxel) const {
    return {voxel.x() / edge_.x(), voxel.y() / edge_.y(), voxel.z() / edge_.z()};
  }
  [[nodiscard]] std::size_t positionInBrick(const Coord& voxel) const {
    return index({voxel.x() % edge_.x(), voxel.y() % edge_.y(), voxel.z() % edge_.z()}, edge_);
  }
  [[nodiscard]] std::size_t stored(const Coord& voxel) const {
    return index(brickOf(voxel), count_) * volume() + positionInBrick(voxel);
  }
  [[nodiscard]] Coord voxel(std::size_t stored) const {
    const Coord brick = position(stored / volume(), count_);
    const Coord inside = position(stored % volume(), edge_);
    return {brick.x() * edge_.x() + inside.x(), brick.y() * edge_.y() + inside.y(),
            brick.z() * edge_.z() + inside.z()};
  }

  /// x fastest.
  static std::size_t index(const Coord& at, const Coord& size) {
    return at.x() + static_cast<std::size_t>(size.x()) *
                        (at.y() + static_cast<std::size_t>(size.y()) * at.z());
  }
  static Coord position(std::size_t index, const Coord& size) {
    const std::size_t x = size.x();
    const std::size_t y = size.y();
    return {static_cast<int>(index % x), static_cast<int>(index / x % y),
            static_cast<int>(index / x / y)};
  }

 private:
  static std::size_t volume(const Coord& size) { return index({0, 0, size.z()}, size); }

  Coord size_;
  Coord edge_;
  Coord count_;
};

/// The bits of an energy, from the highest: the sign, set or not, the sum of weights, the order
/// among equals.
template <class Energy>
struct Bits {
  /// Added to the energy of set voxels, so that the minimum is always a void and the maximum a
  /// cluster.
  static constexpr int set = std::numeric_limits<Energy>::digits - 1;
  static constexpr int ties = sizeof(Energy) == 8 ? 15 : 4;
  static constexpr int finest = 40;
};

/// The kernel around a centre at one position in its brick, as bricks of integer weights.
template <class Energy>
struct CentredKernel {
  /// Bricks counted from that of the centre, each in [0, count of bricks).
  struct Offset {
    std::uint16_t x, y, z;
  };
  std::vector<Offset> bricks;
  std::size_t negative_bricks = 0;  ///< the number that hold a negative weight; they come first
  std::vector<Energy> weights;      ///< brick by brick
};

/// One for every position of the centre in its brick.
template <class Energy>
using IntegerKernel = std::vector<CentredKernel<Energy>>;

template <class Energy>
IntegerKernel<Energy> integerKernel(const VoidAndCluster& settings, const Bricks& bricks) {
  const Coord& size = settings.size;
  const ToroidalKernel kernel(settings.kernel, size);
  const double smallest = smallestWeight(size);
  double sum = 0;
  Coord reach(0, 0, 0);
  std::vector<double> values(bricks.voxels());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Coord d = Bricks::position(i, size);
    const double value = kernel(d.x(), d.y(), d.z());
    if (std::abs(value) < smallest) continue;
    values[i] = value;
    sum += std::abs(value);
  }
  const int bits =
      std::min(Bits<Energy>::finest,
               std::ilogb(0.99 * std::ldexp(1.0, Bits<Energy>::set - Bits<Energy>::ties) / sum));
  const double scale = std::ldexp(1.0, bits);
  std::vector<Energy> weights(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    weights[i] =
        static_cast<Energy>(std::llround(values[i] * scale)) * (Energy{1} << Bits<Energy>::ties);
    if (weights[i] == 0) continue;
    const Coord d = Bricks::position(i, size);
    for (int axis = 0; axis < 3; ++axis)
      reach[axis] = std::max(reach[axis], std::min(d[axis], size[axis] - d[axis]));
  }

  // By axis, the bricks that hold a voxel within reach of the centre's brick.
  std::array<std::vector<std::uint16_t>, 3> near;
  for (int axis = 0; axis < 3; ++axis) {
    for (int brick = 0; brick < bricks.count()[axis]; ++brick) {
      const int distance = std::min(brick, bricks.count()[axis] - brick) - 1;
      if (distance * bricks.edge()[axis] < reach[axis])
        near[axis].push_back(static_cast<std::uint16_t>(brick));
    }
  }
  const std::size_t volume = bricks.volume();
  IntegerKernel<Energy> result(volume);
  std::vector<Energy> brick(volume);
  for (const bool negative : {true, false}) {
    for (std::size_t centre = 0; centre < volume; ++centre) {
      CentredKernel<Energy>& centred = result[centre];
      const Coord from = Bricks::position(centre, bricks.edge());
      for (const std::uint16_t z : near[2]) {
        for (const std::uint16_t y : near[1]) {
          for (const std::uint16_t x : near[0]) {
            for (std::size_t i = 0; i < volume; ++i) {
              const Coord inside = Bricks::position(i, bricks.edge());
              const Coord d(x * bricks.edge().x() + inside.x() - from.x(),
                            y * bricks.edge().y() + inside.y() - from.y(),
                            z * bricks.edge().z() + inside.z() - from.z());
              brick[i] = weights[Bricks::index(
                  {d.x() < 0 ? d.x() + size.x() : d.x(), d.y() < 0 ? d.y() + size.y() : d.y(),
                   d.z() < 0 ? d.z() + size.z() : d.z()},
                  size)];
            }
            const auto [minimum, maximum] = std::minmax_element(brick.begin(), brick.end());
            if ((*minimum == 0 && *maximum == 0) || (*minimum < 0) != negative) continue;
            centred.bricks.push_back({x, y, z});
            centred.weights.insert(centred.weights.end(), brick.begin(), brick.end());
          }
        }
      }
      if (negative) centred.negative_bricks = centred.bricks.size();
    }
  }
  return result;
}

/// The energies of a tile, and the places of the bricks around each brick.
template <class Energy>
class Tile {
 public:
  explicit Tile(const Coord& size) : bricks_(size), energies_(bricks_.voxels()) {
    std::size_t step = bricks_.volume();
    for (int axis = 0; axis < 3; ++axis) {
      const int count = bricks_.count()[axis];
      for (int i = 0; i < 2 * count; ++i) steps_[axis].push_back(i % count * step);
      step *= count;
    }
  }

  [[nodiscard]] const Bricks& bricks() const { return bricks_; }
  [[nodiscard]] std::vector<Energy>& energies() { return energies_; }
  [[nodiscard]] const std::vector<Energy>& energies() const { return energies_; }
  /// Returns tables by x, y and z of offsets from `brick`: their sum is where the brick is stored.
  [[nodiscard]] std::array<const std::size_t*, 3> from(const Coord& brick) const {
    return {steps_[0].data() + brick.x(), steps_[1].data() + brick.y(),
            steps_[2].data() + brick.z()};
  }

 private:
  Bricks bricks_;
  std::vector<Energy> energies_;
  std::array<std::vector<std::size_t>, 3> steps_;
};

/// Bounds exist for groups of this many values, and for groups of as many groups.
constexpr std::size_t group = 64;

/// Lower bounds of sign · energy: of every group of energies, of every group of those, and so on.
template <class Energy>
using Bounds = std::vector<std::vector<Energy>>;

/// Adds the kernel around a voxel (sign 1) or subtracts it (sign -1). Bricks have `fixed` voxels if
/// it is not zero.
template <int sign, std::size_t fixed, class Energy>
[[gnu::always_inline]] inline void deposit(Tile<Energy>& tile, const IntegerKernel<Energy>& kernel,
                                           const Coord& centre) {
  const std::size_t volume = fixed ? fixed : tile.bricks().volume();
  const CentredKernel<Energy>& centred = kernel[tile.bricks().positionInBrick(centre)];
  const auto [x, y, z] = tile.from(tile.bricks().brickOf(centre));
  Energy* const energies = tile.energies().data();
  const Energy* __restrict weight = centred.weights.data();
  // All lines are prefetched before the first is needed, which halves the time of a tile larger
  // than the cache.
  for (const auto& brick : centred.bricks) {
    __builtin_prefetch(energies + x[brick.x] + y[brick.y] + z[brick.z], 1);
  }
  for (const auto& brick : centred.bricks) {
    Energy* __restrict const energy = energies + x[brick.x] + y[brick.y] + z[brick.z];
    for (std::size_t i = 0; i < volume; ++i) energy[i] += sign * weight[i];
    weight += volume;
  }
}

/// Returns the minimum of sign · value over `count` ≥ 1 values.
template <int sign, class Energy>
[[gnu::always_inline]] inline Energy minimumOf(const Energy* values, std::size_t count) {
  Energy minimum = std::numeric_limits<Energy>::max();
  for (std::size_t i = 0; i < count; ++i) minimum = std::min<Energy>(minimum, sign * values[i]);
  return minimum;
}

/// Lowers the bounds to the energies in the first bricks of the kernel around `centre`.
template <int sign, std::size_t fixed, class Energy>
[[gnu::always_inline]] inline void lowerBounds(const Tile<Energy>& tile,
                                               const CentredKernel<Energy>& kernel,
                                               std::size_t brick_count, const Coord& centre,
                                               Bounds<Energy>& bounds) {
  const std::size_t volume = fixed ? fixed : tile.bricks().volume();
  const auto [x, y, z] = tile.from(tile.bricks().brickOf(centre));
  for (std::size_t i = 0; i < brick_count; ++i) {
    const auto& brick = kernel.bricks[i];
    std::size_t at = x[brick.x] + y[brick.y] + z[brick.z];
    const Energy minimum = minimumOf<sign>(tile.energies().data() + at, volume);
    for (std::vector<Energy>& level : bounds) {
      at /= group;
      if (level[at] <= minimum) break;
      level[at] = minimum;
    }
  }
}

/// The functions above, compiled for an instruction set.
template <int sign, class Energy>
struct Loops {
  void (*deposit)(Tile<Energy>&, const IntegerKernel<Energy>&, const Coord&);
  Energy (*minimum)(const Energy*, std::size_t);
  void (*lower_bounds)(const Tile<Energy>&, const CentredKernel<Energy>&, std::size_t, const Coord&,
                       Bounds<Energy>&);
};

template <int sign, std::size_t fixed, class Energy>
void depositBaseline(Tile<Energy>& tile, const IntegerKernel<Energy>& kernel, const Coord& centre) {
  deposit<sign, fixed>(tile, kernel, centre);
}
template <int sign, class Energy>
Energy minimumBaseline(const Energy* values, std::size_t count) {
  return minimumOf<sign>(values, count);
}
template <int sign, std::size_t fixed, class Energy>
void lowerBoundsBaseline(const Tile<Energy>& tile, const CentredKernel<Energy>& kernel,
                         std::size_t bricks, const Coord& centre, Bounds<Energy>& bounds) {
  lowerBounds<sign, fixed>(tile, kernel, bricks, centre, bounds);
}

#if defined(__x86_64__)
#define VDBDITHER_AVX2 [[gnu::target("avx2")]]
#else
#define VDBDITHER_AVX2
#endif

template <int sign, std::size_t fixed, class Energy>
VDBDITHER_AVX2 void depositAvx2(Tile<Energy>& tile, const IntegerKernel<Energy>& kernel,
                                const Coord& centre) {
  deposit<sign, fixed>(tile, kernel, centre);
}
template <int sign, class Energy>
VDBDITHER_AVX2 Energy minimumAvx2(const Energy* values, std::size_t count) {
  return minimumOf<sign>(values, count);
}
template <int sign, std::size_t fixed, class Energy>
VDBDITHER_AVX2 void lowerBoundsAvx2(const Tile<Energy>& tile, const CentredKernel<Energy>& kernel,
                                    std::size_t bricks, const Coord& centre,
                                    Bounds<Energy>& bounds) {
  lowerBounds<sign, fixed>(tile, kernel, bricks, centre, bounds);
}

template <int sign, std::size_t fixed, class Energy>
Loops<sign, Energy> loopsFor(InstructionSet instructions) {
  if (instructions == InstructionSet::avx2) {
    return {depositAvx2<sign, fixed, Energy>, minimumAvx2<sign, Energy>,
            lowerBoundsAvx2<sign, fixed, Energy>};
  }
  return {depositBaseline<sign, fixed, Energy>, minimumBaseline<sign, Energy>,
          lowerBoundsBaseline<sign, fixed, Energy>};
}

template <int sign, class Energy>
Loops<sign, Energy> loopsFor(InstructionSet instructions, const Bricks& bricks) {
  return bricks.volume() == whole_brick ? loopsFor<sign, whole_brick, Energy>(instructions)
                                        : loopsFor<sign, 0, Energy>(instructions);
}

/// Finds the voxel with the minimum of sign · energy, the first stored of equals. The bounds stay
/// valid when energies rise.
template <int sign, class Energy>
class Extremum {
 public:
  Extremum(const Tile<Energy>& tile, InstructionSet instructions)
      : tile_(tile),
        loops_(loopsFor<sign, Energy>(instructions, tile.bricks())),
        minimum_bound_(loopsFor<1, Energy>(instructions, tile.bricks()).minimum) {
    std::size_t count = tile.energies().size();
    do {
      count = (count + group - 1) / group;
      bounds_.emplace_back(count, std::numeric_limits<Energy>::min());
    } while (count > 1);
  }

  /// Keeps the bounds valid after the kernel around `centre` was added (change 1) or subtracted
  /// (change -1).
  void follow(const IntegerKernel<Energy>& kernel, const Coord& centre, int change) {
    const CentredKernel<Energy>& centred = kernel[tile_.bricks().positionInBrick(centre)];
    loops_.lower_bounds(tile_, centred,
                        change == sign ? centred.negative_bricks : centred.bricks.size(), centre,
                        bounds_);
  }

  Coord find() {
    const std::vector<Energy>& energies = tile_.energies();
    std::size_t exact = energies.size();
    while (true) {
      std::size_t at = 0;
      for (auto level = bounds_.rbegin(); level != bounds_.rend(); ++level)
        at = whereMinimum(*level, at);
      if (at == exact) {
        std::size_t found = at * group;
        while (sign * energies[found] != bounds_[0][at]) ++found;
        return tile_.bricks().voxel(found);
      }
      exact = at;
      bounds_[0][at] = loops_.minimum(energies.data() + at * group, groupSize(energies, at));
      for (std::size_t level = 1; level < bounds_.size(); ++level) {
        at /= group;
        bounds_[level][at] = minimumBound(bounds_[level - 1], at);
      }
    }
  }

 private:
  static std::size_t groupSize(const std::vector<Energy>& values, std::size_t at) {
    return std::min(group, values.size() - at * group);
  }
  Energy minimumBound(const std::vector<Energy>& bounds, std::size_t at) const {
    return minimum_bound_(bounds.data() + at * group, groupSize(bounds, at));
  }
  std::size_t whereMinimum(const std::vector<Energy>& bounds, std::size_t at) const {
    const Energy minimum = minimumBound(bounds, at);
    std::size_t where = at * group;
    while (bounds[where] != minimum) ++where;
    return where;
  }

  const Tile<Energy>& tile_;
  Loops<sign, Energy> loops_;
  Energy (*minimum_bound_)(const Energy*, std::size_t);
  Bounds<Energy> bounds_;
};

/// Counts the steps of a run and reports from time to time.
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

template <class Energy>
std::vector<std::uint32_t> ranksOf(const VoidAndCluster& settings,
                                   const std::function<void(double)>& progress,
                                   InstructionSet instructions) {
  constexpr Energy set_bias = Energy{1} << Bits<Energy>::set;
  Tile<Energy> tile(settings.size);
  const Bricks& bricks = tile.bricks();
  const IntegerKernel<Energy> kernel = integerKernel<Energy>(settings, bricks);
  const auto count = static_cast<std::uint32_t>(bricks.voxels());
  const std::uint32_t initial = initialCount(count);
  const std::vector<std::uint32_t> order = randomPermutation(count, settings.seed);
  Progress work(progress, count + 1.4 * initial);

  const auto add = loopsFor<1, Energy>(instructions, bricks).deposit;
  const auto subtract = loopsFor<-1, Energy>(instructions, bricks).deposit;
  const auto set = [&](const Coord& voxel) {
    add(tile, kernel, voxel);
    tile.energies()[bricks.stored(voxel)] += set_bias;
    work.step();
  };
  const auto clear = [&](const Coord& voxel) {
    subtract(tile, kernel, voxel);
    tile.energies()[bricks.stored(voxel)] -= set_bias;
  };

  for (std::uint32_t i = 0; i < count; ++i) {
    const Coord voxel = Bricks::position(i, settings.size);
    tile.energies()[bricks.stored(voxel)] += order[i] % (1u << Bits<Energy>::ties);
    if (order[i] < initial) set(voxel);
  }
  {
    Extremum<1, Energy> voids(tile, instructions);
    Extremum<-1, Energy> clusters(tile, instructions);
    while (true) {
      const Coord from = clusters.find();
      clear(from);
      voids.follow(kernel, from, -1);
      clusters.follow(kernel, from, -1);
      const Coord to = voids.find();
      set(to);
      if (to == from) break;
      voids.follow(kernel, to, 1);
      clusters.follow(kernel, to, 1);
    }
  }
  std::vector<std::uint32_t> ranks(count);
  const std::vector<Energy> converged = tile.energies();
  Extremum<-1, Energy> clusters(tile, instructions);
  for (std::uint32_t rank = initial; rank-- > 0;) {
    const Coord voxel = clusters.find();
    ranks[Bricks::index(voxel, settings.size)] = rank;
    clear(voxel);
    clusters.follow(kernel, voxel, -1);
    work.step();
  }
  tile.energies() = converged;
  Extremum<1, Energy> voids(tile, instructions);
  for (std::uint32_t rank = initial; rank < count; ++rank) {
    const Coord voxel = voids.find();
    ranks[Bricks::index(voxel, settings.size)] = rank;
    set(voxel);
    voids.follow(kernel, voxel, 1);
  }
  return ranks;
}

bool isSmall(const Coord& size) { return Bricks(size).voxels() <= 32768; }

std::uint64_t nextRandom(std::uint64_t& state) { return scattered(state += split_mix_step); }

}  // namespace

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

double smallestWeight(const openvdb::Coord& size) {
  return isSmall(size) ? 0 : std::ldexp(1.0, -12);
}

double voidAndClusterSeconds(const VoidAndCluster& settings) {
  const Coord& size = settings.size;
  const bool small = isSmall(size);
  const double smallest =
      small ? std::ldexp(1.0, -1 - Bits<std::int64_t>::finest) : smallestWeight(size);
  const ToroidalKernel kernel(settings.kernel, size);
  // The kernel is symmetric along every axis.
  double looked_at = 0;
  double weights = 0;
  for (int z = 0; z <= size.z() / 2; ++z) {
    for (int y = 0; y <= size.y() / 2; ++y) {
      for (int x = 0; x <= size.x() / 2; ++x) {
        ++looked_at;
        if (std::abs(kernel(x, y, z)) >= smallest) ++weights;
      }
    }
  }
  const double voxels = static_cast<double>(size.x()) * size.y() * size.z();
  const double steps = voxels + initialCount(static_cast<std::uint32_t>(voxels));
  const double touched = weights / looked_at * voxels;
  // Above a million voxels the energies do not fit the cache.
  const double ns_per_weight = voxels > 1 << 20 ? 2.6 : 1;
  return 1e-9 * steps * (500 + ns_per_weight * touched);
}

std::vector<std::uint32_t> voidAndCluster(const VoidAndCluster& settings,
                                          const std::function<void(double fraction)>& progress,
                                          InstructionSet instructions) {
  return isSmall(settings.size) ? ranksOf<std::int64_t>(settings, progress, instructions)
                                : ranksOf<std::int32_t>(settings, progress, instructions);
}

}  // namespace vdbdither
